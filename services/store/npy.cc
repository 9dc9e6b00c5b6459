#include "services/store/npy.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

#include "proto/check.h"
#include "services/store/file.h"

namespace flamefield {

namespace {

static_assert(std::endian::native == std::endian::little, "byte orders are written for little-endian hosts");
constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kMaxHeaderBytes = 1u << 16;

tl::unexpected<Error> bad(const std::filesystem::path& path, std::string_view why,
                          std::string_view suggestion = "copy or save the file again") {
  return invalid_input(concat("cannot read '", path.string(), "'"), why, suggestion);
}

// What stands after 'key': in the header's Python dictionary, up to the end of the text.
std::optional<std::string_view> value_after(std::string_view header, std::string_view key) {
  const auto at = header.find(concat("'", key, "'"));
  if (at == std::string_view::npos) return std::nullopt;
  const auto colon = header.find(':', at);
  if (colon == std::string_view::npos) return std::nullopt;
  const auto begin = header.find_first_not_of(' ', colon + 1);
  if (begin == std::string_view::npos) return std::nullopt;
  return header.substr(begin);
}

std::optional<std::vector<std::size_t>> parse_shape(std::string_view text) {
  if (!text.starts_with('(')) return std::nullopt;
  const auto end = text.find(')');
  if (end == std::string_view::npos) return std::nullopt;
  std::vector<std::size_t> shape;
  text = text.substr(1, end - 1);
  while (true) {
    const auto begin = text.find_first_not_of(" ,");
    if (begin == std::string_view::npos) return shape;
    text.remove_prefix(begin);
    std::size_t side = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), side);
    if (error != std::errc()) return std::nullopt;
    shape.push_back(side);
    text.remove_prefix(static_cast<std::size_t>(rest - text.data()));
  }
}

struct Header {
  std::size_t bytes_per_value = 0;
  bool swapped = false;
  std::vector<std::size_t> shape;
};

Result<Header> parse_header(const std::filesystem::path& path, std::string_view text) {
  const auto descr = value_after(text, "descr");
  const auto fortran = value_after(text, "fortran_order");
  const auto shape_text = value_after(text, "shape");
  if (!descr || !fortran || !shape_text) return bad(path, "its .npy header is damaged");
  Header header;
  if (descr->starts_with("'<f4'") || descr->starts_with("'>f4'"))
    header.bytes_per_value = 4;
  else if (descr->starts_with("'<f8'") || descr->starts_with("'>f8'"))
    header.bytes_per_value = 8;
  else
    return bad(path, concat("its type is ", descr->substr(0, descr->find(',')), ", not a float"),
               "save it with numpy.save(path, array.astype('float32'))");
  header.swapped = descr->starts_with("'>");
  if (!fortran->starts_with("False"))
    return bad(path, "the array is in Fortran order", "save numpy.ascontiguousarray(array)");
  auto shape = parse_shape(*shape_text);
  if (!shape) return bad(path, "its .npy header is damaged");
  header.shape = *shape;
  return header;
}

Result<std::string> read_header_text(const std::filesystem::path& path, InputFile& file) {
  std::array<char, 12> start{};
  file.stream.read(start.data(), 8);
  if (!file.stream || std::string_view(start.data(), kMagic.size()) != kMagic)
    return bad(path, "not a .npy file", "save it with numpy.save");
  const int version = start[6];
  if (version < 1 || version > 3) return bad(path, concat("unknown .npy version ", version));
  const std::size_t length_bytes = version == 1 ? 2 : 4;
  file.stream.read(start.data() + 8, static_cast<std::streamsize>(length_bytes));
  std::size_t length = 0;
  for (std::size_t i = 0; i < length_bytes; ++i)
    length |= static_cast<std::size_t>(static_cast<unsigned char>(start[8 + i])) << (8 * i);
  if (!file.stream || length > kMaxHeaderBytes || length > file.size_bytes)
    return bad(path, "its .npy header is damaged or cut short");
  std::string text(length, '\0');
  file.stream.read(text.data(), static_cast<std::streamsize>(length));
  if (!file.stream) return bad(path, "its .npy header is cut short");
  return text;
}

template <class T>
T value_at(const char* bytes, bool swapped) {
  std::array<char, sizeof(T)> copy;
  std::memcpy(copy.data(), bytes, sizeof(T));
  if (swapped) std::reverse(copy.begin(), copy.end());
  return std::bit_cast<T>(copy);
}

}  // namespace

Result<NpyArray> read_npy(const std::filesystem::path& path) {
  auto file = open_input(path);
  if (!file) return tl::unexpected(file.error());
  auto text = read_header_text(path, *file);
  if (!text) return tl::unexpected(text.error());
  auto header = parse_header(path, *text);
  if (!header) return tl::unexpected(header.error());

  const std::uint64_t payload = file->size_bytes - static_cast<std::uint64_t>(file->stream.tellg());
  std::uint64_t count = 1;
  for (std::size_t side : header->shape) {
    if (side != 0 && count > file->size_bytes / side)
      return bad(path, "cut short: its shape needs more data");
    count *= side;
  }
  if (count * header->bytes_per_value != payload) {
    return bad(path, concat(count * header->bytes_per_value < payload ? "too long: " : "cut short: ", payload,
                            " bytes of data where its shape needs ", count * header->bytes_per_value));
  }
  NpyArray array{header->shape, std::vector<float>(count)};
  if (header->bytes_per_value == 4 && !header->swapped) {
    file->stream.read(reinterpret_cast<char*>(array.values.data()), static_cast<std::streamsize>(payload));
  } else {
    std::vector<char> bytes(payload);
    file->stream.read(bytes.data(), static_cast<std::streamsize>(payload));
    for (std::size_t i = 0; i < count; ++i) {
      const char* at = bytes.data() + i * header->bytes_per_value;
      array.values[i] = header->bytes_per_value == 4
                            ? value_at<float>(at, header->swapped)
                            : static_cast<float>(value_at<double>(at, header->swapped));
    }
  }
  if (!file->stream) return bad(path, "the data could not be read");
  return array;
}

Result<> write_npy(const std::filesystem::path& path, const std::vector<std::size_t>& shape,
                   std::span<const float> values) {
  std::size_t count = 1;
  std::string sides;
  for (std::size_t side : shape) {
    count *= side;
    sides += concat(side, ", ");
  }
  expect(count == values.size(), "as many values as the shape says");
  if (shape.size() > 1) sides.resize(sides.size() - 2);
  if (shape.size() == 1) sides.pop_back();
  std::string header = concat("{'descr': '<f4', 'fortran_order': False, 'shape': (", sides, "), }");
  // The whole preamble is a multiple of 64 bytes and ends with a newline.
  header.resize((kMagic.size() + 4 + header.size() + 1 + 63) / 64 * 64 - kMagic.size() - 5, ' ');
  header += '\n';

  auto file = AtomicFile::create(path);
  if (!file) return tl::unexpected(file.error());
  std::string preamble(kMagic);
  preamble += {'\1', '\0', static_cast<char>(header.size() & 255), static_cast<char>(header.size() >> 8)};
  if (auto ok = file->write(preamble + header); !ok) return ok;
  if (auto ok = file->write(std::as_bytes(values)); !ok) return ok;
  return file->commit();
}

}  // namespace flamefield
