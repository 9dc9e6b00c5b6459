#include <bit>
#include <charconv>
#include <cstring>

#include "services/store/file.h"
#include "services/store/volume_formats.h"

namespace flamefield {

namespace {

static_assert(std::endian::native == std::endian::little, "the header says LittleEndian");
constexpr std::size_t kMaxHeaderBytes = 1u << 16;

std::string triple(const Eigen::Vector3d& v) {
  std::string text;
  for (double value : v) {
    char buffer[40];
    text += std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr) + " ";
  }
  text.pop_back();
  return text;
}

tl::unexpected<Error> bad(const std::filesystem::path& path, std::string_view why) {
  return invalid_input(concat("cannot read '", path.string(), "'"), why, "convert it to .vtkhdf or .npy");
}

// Numbers of the attribute name="..." in the first tag that has it.
std::vector<double> numbers(std::string_view xml, std::string_view name) {
  std::vector<double> values;
  const auto key = concat(" ", name, "=\"");
  const auto begin = xml.find(key);
  if (begin == std::string_view::npos) return values;
  std::string_view text = xml.substr(begin + key.size());
  text = text.substr(0, text.find('"'));
  while (!text.empty()) {
    if (text.front() == ' ') {
      text.remove_prefix(1);
      continue;
    }
    double value = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc()) return {};
    values.push_back(value);
    text.remove_prefix(static_cast<std::size_t>(rest - text.data()));
  }
  return values;
}

Result<Grid> parse_grid(const std::filesystem::path& path, std::string_view xml) {
  const auto extent = numbers(xml, "WholeExtent"), origin = numbers(xml, "Origin"),
             spacing = numbers(xml, "Spacing");
  const auto has = [&](std::string_view text) { return xml.find(text) != std::string_view::npos; };
  if (extent.size() != 6 || origin.size() != 3 || spacing.size() != 3 || !has("type=\"ImageData\"") ||
      !has("type=\"Float32\"") || !has("format=\"appended\"") || !has("header_type=\"UInt64\"") ||
      !has("byte_order=\"LittleEndian\"") || !has("encoding=\"raw\"") || has("compressor=")) {
    return bad(path, "not an ImageData file with raw, appended Float32 data");
  }
  Grid grid;
  const std::array<int*, 3> sides = {&grid.nx, &grid.ny, &grid.nz};
  for (std::size_t a = 0; a < 3; ++a) {
    const double side = extent[2 * a + 1] - extent[2 * a] + 1;
    if (!(side >= 1 && side < (1 << 24))) return bad(path, "WholeExtent is out of range");
    *sides[a] = static_cast<int>(side);
    const auto i = static_cast<Eigen::Index>(a);
    grid.spacing_mm[i] = spacing[a];
    grid.origin_mm[i] = origin[a] + extent[2 * a] * spacing[a];
  }
  if (auto ok = validate(grid); !ok) return tl::unexpected(ok.error());
  return grid;
}

}  // namespace

Result<> write_vti(const std::filesystem::path& path, const Volume& volume) {
  const Grid& g = volume.grid;
  const std::string extent = concat("0 ", g.nx - 1, " 0 ", g.ny - 1, " 0 ", g.nz - 1);
  const std::string header = concat(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n  <ImageData WholeExtent=\"",
      extent, "\" Origin=\"", triple(g.origin_mm), "\" Spacing=\"", triple(g.spacing_mm),
      "\">\n    <Piece Extent=\"", extent,
      "\">\n      <PointData Scalars=\"emission\">\n        <DataArray type=\"Float32\" Name=\"emission\" "
      "format=\"appended\" offset=\"0\"/>\n      </PointData>\n    </Piece>\n  </ImageData>\n"
      "  <AppendedData encoding=\"raw\">\n   _");
  const std::uint64_t bytes = volume.values.size() * sizeof(float);
  auto file = AtomicFile::create(path);
  if (!file) return tl::unexpected(file.error());
  if (auto ok = file->write(header); !ok) return ok;
  if (auto ok = file->write(std::as_bytes(std::span(&bytes, 1))); !ok) return ok;
  if (auto ok = file->write(std::as_bytes(std::span(volume.values))); !ok) return ok;
  if (auto ok = file->write("\n  </AppendedData>\n</VTKFile>\n"); !ok) return ok;
  return file->commit();
}

Result<Volume> read_vti(const std::filesystem::path& path) {
  auto file = open_input(path);
  if (!file) return tl::unexpected(file.error());
  std::string start(std::min<std::uint64_t>(file->size_bytes, kMaxHeaderBytes), '\0');
  file->stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  const auto tag = start.find("<AppendedData");
  const auto underscore = tag == std::string::npos ? tag : start.find('_', tag);
  if (underscore == std::string::npos) return bad(path, "it is cut short or has no appended data");
  auto grid = parse_grid(path, std::string_view(start).substr(0, underscore));
  if (!grid) return tl::unexpected(grid.error());

  file->stream.clear();
  file->stream.seekg(static_cast<std::streamoff>(underscore + 1));
  std::uint64_t bytes = 0;
  file->stream.read(reinterpret_cast<char*>(&bytes), sizeof bytes);
  const std::uint64_t wanted = grid->voxels() * sizeof(float);
  if (!file->stream || bytes != wanted || file->size_bytes - underscore - 1 - sizeof bytes < wanted) {
    return bad(path, "it is cut short, or its data do not fit its extent");
  }
  Volume volume(*grid);
  file->stream.read(reinterpret_cast<char*>(volume.values.data()), static_cast<std::streamsize>(wanted));
  if (!file->stream) return bad(path, "the data could not be read");
  return volume;
}

}  // namespace flamefield
