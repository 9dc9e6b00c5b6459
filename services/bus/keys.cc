#include "services/bus/keys.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zmq.h>

#include <array>
#include <cstring>
#include <fstream>
#include <vector>

#include "proto/check.h"

namespace flamefield {

namespace {

namespace fs = std::filesystem;
constexpr std::size_t kKeyLength = 40;
constexpr std::array kRoles = {"dispatcher", "producer", "worker", "client"};

bool is_key(const std::string& text) {
  std::array<std::uint8_t, 32> bytes{};
  return text.size() == kKeyLength && zmq_z85_decode(bytes.data(), text.c_str()) != nullptr;
}

Result<> write_file(const fs::path& path, const std::string& text, mode_t mode) {
  // Created with its final mode, so that the secret is never readable by others, not even for a moment.
  const fs::path temporary = path.string() + ".new";
  ::unlink(temporary.c_str());
  const int fd = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  bool ok = fd >= 0 && ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
            ::fsync(fd) == 0;
  if (fd >= 0) ok = ::close(fd) == 0 && ok;
  ok = ok && ::rename(temporary.c_str(), path.c_str()) == 0;
  if (ok) return {};
  return unavailable(concat("cannot write key file ", path.string()), std::strerror(errno),
                     "check permissions and free space");
}

Result<std::vector<std::string>> read_lines(const fs::path& path) {
  std::ifstream in(path);
  if (!in)
    return not_found(concat("key file ", path.string()), std::strerror(errno),
                     "copy it from the dispatcher's machine");
  std::vector<std::string> lines;
  for (std::string line; lines.size() < 4 && std::getline(in, line);) lines.push_back(line);
  return lines;
}

tl::unexpected<Error> damaged(const fs::path& path) {
  return invalid_input(concat("key file ", path.string()), "it does not hold Z85 keys of 40 characters",
                       "restore it, or delete it to have new keys made");
}

Result<std::string> read_public(const fs::path& path) {
  const auto lines = read_lines(path);
  if (!lines) return tl::unexpected(lines.error());
  if (lines->empty() || !is_key((*lines)[0])) return damaged(path);
  return (*lines)[0];
}

Result<KeyPair> read_pair(const fs::path& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0 && (info.st_mode & 077) != 0)
    return invalid_input(concat("secret key ", path.string()), "others than its owner can read it",
                         concat("chmod 600 ", path.string()));
  const auto lines = read_lines(path);
  if (!lines) return tl::unexpected(lines.error());
  if (lines->size() < 2 || !is_key((*lines)[0]) || !is_key((*lines)[1])) return damaged(path);
  return KeyPair{(*lines)[1], (*lines)[0]};
}

// "worker-node7.pub" -> "worker"
std::string role_of(const fs::path& path) {
  const std::string stem = path.stem().string();
  return stem.substr(0, stem.find('-'));
}

}  // namespace

KeyPair generate_keys() {
  std::array<char, kKeyLength + 1> public_key{}, secret_key{};
  const int failed = zmq_curve_keypair(public_key.data(), secret_key.data());
  expect(failed == 0, "libzmq was built with CURVE");
  return {public_key.data(), secret_key.data()};
}

Result<KeyRing> KeyRing::open_or_create(const fs::path& directory) {
  std::error_code problem;
  if (!fs::exists(directory)) {
    fs::create_directories(directory, problem);
    fs::permissions(directory, fs::perms::owner_all, problem);
  }
  KeyRing ring;
  for (const char* role : kRoles) {
    const fs::path secret = directory / concat(role, ".key"), open = directory / concat(role, ".pub");
    if (!fs::exists(secret, problem)) {
      const KeyPair made = generate_keys();
      if (auto ok = write_file(secret, made.secret_key + "\n" + made.public_key + "\n", 0600); !ok)
        return tl::unexpected(ok.error());
    }
    const auto pair = read_pair(secret);
    if (!pair) return tl::unexpected(pair.error());
    const auto shared = read_public(open);
    if (!shared || *shared != pair->public_key) {
      if (auto ok = write_file(open, pair->public_key + "\n", 0644); !ok) return tl::unexpected(ok.error());
    }
    ring.pairs_[role] = *pair;
  }
  ring.dispatcher_public_key_ = ring.of("dispatcher").public_key;
  for (const auto& entry : fs::directory_iterator(directory, problem)) {
    if (entry.path().extension() != ".pub" || role_of(entry.path()) == "dispatcher") continue;
    const auto key = read_public(entry.path());
    if (!key) return tl::unexpected(key.error());
    ring.allowed_[*key] = role_of(entry.path());
  }
  return ring;
}

Result<KeyRing> KeyRing::open(const fs::path& directory, const std::string& role) {
  const auto pair = read_pair(directory / (role + ".key"));
  if (!pair) return tl::unexpected(pair.error());
  const auto dispatcher = read_public(directory / "dispatcher.pub");
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  KeyRing ring;
  ring.pairs_[role] = *pair;
  ring.dispatcher_public_key_ = *dispatcher;
  return ring;
}

const KeyPair& KeyRing::of(const std::string& role) const {
  const auto found = pairs_.find(role);
  expect(found != pairs_.end(), "the key ring was opened for this role");
  return found->second;
}

}  // namespace flamefield
