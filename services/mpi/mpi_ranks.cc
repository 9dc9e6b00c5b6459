#include "services/mpi/mpi_ranks.h"

#define OMPI_SKIP_MPICXX  // the C++ bindings, gone since MPI-3
#include <mpi.h>

#include <algorithm>
#include <numeric>

namespace flamefield {

namespace {

// MPI counts in int; larger messages go in pieces.
constexpr std::size_t kPiece = std::size_t{1} << 30;

template <class Work>
void in_pieces(std::size_t size, const Work& work) {
  for (std::size_t at = 0; at < size; at += kPiece) work(at, static_cast<int>(std::min(kPiece, size - at)));
}

}  // namespace

MpiRanks::MpiRanks(int* argc, char*** argv) {
  int provided = 0;  // the mathematics' threads do not talk to MPI
  MPI_Init_thread(argc, argv, MPI_THREAD_FUNNELED, &provided);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &count_);
}

MpiRanks::~MpiRanks() {
  MPI_Finalize();
}

void MpiRanks::exchange(int to, ConstBytes out, int from, Bytes in) {
  MPI_Request request = MPI_REQUEST_NULL;
  const std::size_t incoming = from == kNobody ? 0 : in.size(), outgoing = to == kNobody ? 0 : out.size();
  std::vector<MPI_Request> pending;
  in_pieces(incoming, [&](std::size_t at, int size) {
    MPI_Irecv(in.data() + at, size, MPI_BYTE, from, 0, MPI_COMM_WORLD, &request);
    pending.push_back(request);
  });
  in_pieces(outgoing, [&](std::size_t at, int size) {
    MPI_Isend(out.data() + at, size, MPI_BYTE, to, 0, MPI_COMM_WORLD, &request);
    pending.push_back(request);
  });
  MPI_Waitall(static_cast<int>(pending.size()), pending.data(), MPI_STATUSES_IGNORE);
}

void MpiRanks::broadcast(int from, Bytes bytes) {
  in_pieces(bytes.size(), [&](std::size_t at, int size) {
    MPI_Bcast(bytes.data() + at, size, MPI_BYTE, from, MPI_COMM_WORLD);
  });
}

std::vector<std::vector<std::byte>> MpiRanks::gather(ConstBytes bytes) {
  const int size = static_cast<int>(bytes.size());
  std::vector<int> sizes(static_cast<std::size_t>(count_)), starts(sizes.size(), 0);
  MPI_Allgather(&size, 1, MPI_INT, sizes.data(), 1, MPI_INT, MPI_COMM_WORLD);
  std::partial_sum(sizes.begin(), sizes.end() - 1, starts.begin() + 1);
  std::vector<std::byte> all(static_cast<std::size_t>(starts.back() + sizes.back()));
  MPI_Allgatherv(bytes.data(), size, MPI_BYTE, all.data(), sizes.data(), starts.data(), MPI_BYTE,
                 MPI_COMM_WORLD);
  std::vector<std::vector<std::byte>> out;
  for (std::size_t r = 0; r < sizes.size(); ++r)
    out.emplace_back(all.begin() + starts[r], all.begin() + starts[r] + sizes[r]);
  return out;
}

}  // namespace flamefield
