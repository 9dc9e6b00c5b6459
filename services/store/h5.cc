#include "services/store/h5.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <mutex>
#include <utility>

namespace flamefield {

namespace {

using Closer = herr_t (*)(hid_t);

// Owns one HDF5 identifier.
class Handle {
 public:
  Handle(hid_t id, Closer close, std::string_view what) : id_(id), close_(close) {
    if (id < 0) throw H5Failure(concat(what, " failed; the file is damaged, cut short, or not of this kind"));
  }
  Handle(const Handle&) = delete;
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  operator hid_t() const { return id_; }
  hid_t release() { return std::exchange(id_, H5I_INVALID_HID); }

 private:
  hid_t id_;
  Closer close_;
};

void check(herr_t status, std::string_view what) {
  if (status < 0) throw H5Failure(concat(what, " failed"));
}

// The library prints its errors unless told not to; the setting is per thread.
void be_silent() {
  thread_local const bool done = [] {
    H5dont_atexit();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    return true;
  }();
  static_cast<void>(done);
}

hid_t memory_type(H5Number number) {
  switch (number) {
    case H5Number::F32:
      return H5T_NATIVE_FLOAT;
    case H5Number::F64:
      return H5T_NATIVE_DOUBLE;
    case H5Number::I64:
      return H5T_NATIVE_INT64;
    case H5Number::U8:
      return H5T_NATIVE_UINT8;
    case H5Number::U16:
      return H5T_NATIVE_UINT16;
  }
  return H5I_INVALID_HID;
}

hid_t file_type(H5Number number) {
  switch (number) {
    case H5Number::F32:
      return H5T_IEEE_F32LE;
    case H5Number::F64:
      return H5T_IEEE_F64LE;
    case H5Number::I64:
      return H5T_STD_I64LE;
    case H5Number::U8:
      return H5T_STD_U8LE;
    case H5Number::U16:
      return H5T_STD_U16LE;
  }
  return H5I_INVALID_HID;
}

// Without times of day, so that equal data give equal files.
Handle timeless(hid_t kind) {
  Handle plist(H5Pcreate(kind), H5Pclose, "making a property list");
  check(H5Pset_obj_track_times(plist, false), "leaving times out");
  return Handle(plist.release(), H5Pclose, "making a property list");
}

Handle text_type(std::size_t length, bool ascii) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "making a text type");
  check(H5Tset_size(type, std::max<std::size_t>(length, 1)), "sizing a text type");
  check(H5Tset_strpad(type, H5T_STR_NULLPAD), "padding a text type");
  check(H5Tset_cset(type, ascii ? H5T_CSET_ASCII : H5T_CSET_UTF8), "choosing a character set");
  return Handle(type.release(), H5Tclose, "making a text type");
}

bool is_ascii(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 128; });
}

// Texts side by side in fields of one width.
struct PackedTexts {
  std::size_t width = 1;
  bool ascii = true;
  std::string bytes;
};
PackedTexts packed(const std::vector<std::string>& texts) {
  PackedTexts pack;
  for (const std::string& text : texts) {
    pack.width = std::max(pack.width, text.size());
    pack.ascii = pack.ascii && is_ascii(text);
  }
  for (const std::string& text : texts) pack.bytes += text + std::string(pack.width - text.size(), '\0');
  return pack;
}

constexpr std::size_t kMaxText = 1u << 20;

std::vector<std::string> unpacked(const std::vector<char>& bytes, std::size_t width) {
  std::vector<std::string> texts;
  for (std::size_t at = 0; at + width <= bytes.size(); at += width)
    texts.emplace_back(&bytes[at], strnlen(&bytes[at], width));
  return texts;
}

// Variable-length text, as h5py writes it, becomes the same strings.
template <class Read>
std::vector<std::string> texts_of(hid_t type, std::size_t count, Read read) {
  if (H5Tget_class(type) != H5T_STRING) throw H5Failure("text is expected where there is none");
  if (H5Tis_variable_str(type) > 0) {
    std::vector<char*> pointers(count, nullptr);
    const Handle memory(H5Tcopy(H5T_C_S1), H5Tclose, "making a text type");
    check(H5Tset_size(memory, H5T_VARIABLE), "sizing a text type");
    check(H5Tset_cset(memory, H5Tget_cset(type)), "choosing a character set");
    check(read(memory, pointers.data()), "reading text");
    std::vector<std::string> texts;
    for (char* pointer : pointers) {
      texts.emplace_back(pointer ? pointer : "");
      H5free_memory(pointer);
    }
    return texts;
  }
  const std::size_t width = H5Tget_size(type);
  if (width == 0 || width > kMaxText || count > kMaxText / width) throw H5Failure("a text is too long");
  std::vector<char> bytes(width * count);
  check(read(type, bytes.data()), "reading text");
  return unpacked(bytes, width);
}

void write_attribute(hid_t object, const std::string& name, hid_t type, hid_t memory, hid_t space,
                     const void* values) {
  const Handle attribute(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                         concat("creating attribute '", name, "'"));
  check(H5Awrite(attribute, memory, values), concat("writing attribute '", name, "'"));
}

Handle simple_space(const H5Shape& shape) {
  const std::vector<hsize_t> sides(shape.begin(), shape.end());
  return Handle(H5Screate_simple(static_cast<int>(sides.size()), sides.data(), nullptr), H5Sclose,
                "making a data space");
}

H5Shape shape_of(hid_t space) {
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank < 0 || rank > 8) throw H5Failure("an array has too many dimensions");
  std::array<hsize_t, H5S_MAX_RANK> sides{};
  check(H5Sget_simple_extent_dims(space, sides.data(), nullptr), "reading a shape");
  return {sides.begin(), sides.begin() + rank};
}

Handle open_dataset(hid_t group, const std::string& name) {
  return Handle(H5Dopen2(group, name.c_str(), H5P_DEFAULT), H5Dclose, concat("opening dataset '", name, "'"));
}

template <class T>
std::vector<T> read_attribute(hid_t object, const std::string& name, hid_t memory) {
  const Handle attribute(H5Aopen(object, name.c_str(), H5P_DEFAULT), H5Aclose,
                         concat("opening attribute '", name, "'"));
  const Handle space(H5Aget_space(attribute), H5Sclose, "reading a shape");
  const std::size_t count = H5Group::count_of(shape_of(space));
  if (count > 4096) throw H5Failure(concat("attribute '", name, "' is too long"));
  std::vector<T> values(count);
  check(H5Aread(attribute, memory, values.data()), concat("reading attribute '", name, "'"));
  return values;
}

std::string read_text_attribute(hid_t object, const std::string& name) {
  const Handle attribute(H5Aopen(object, name.c_str(), H5P_DEFAULT), H5Aclose,
                         concat("opening attribute '", name, "'"));
  const Handle space(H5Aget_space(attribute), H5Sclose, "reading a shape");
  const Handle type(H5Aget_type(attribute), H5Tclose, "reading a type");
  if (H5Group::count_of(shape_of(space)) != 1)
    throw H5Failure(concat("attribute '", name, "' is not one text"));
  return texts_of(type, 1, [&](hid_t memory, void* out) { return H5Aread(attribute, memory, out); }).front();
}

// One slice of the first index.
Handle slice_space(hid_t dataset, std::size_t index, Handle& memory) {
  Handle space(H5Dget_space(dataset), H5Sclose, "reading a shape");
  H5Shape shape = shape_of(space);
  if (shape.empty() || index >= shape[0]) throw H5Failure("an array is shorter than its tables say");
  std::vector<hsize_t> start(shape.size(), 0), count(shape.begin(), shape.end());
  start[0] = index;
  count[0] = 1;
  check(H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
        "selecting");
  check(H5Sset_extent_simple(memory, static_cast<int>(count.size()), count.data(), nullptr), "selecting");
  return Handle(space.release(), H5Sclose, "selecting");
}

}  // namespace

std::size_t H5Group::count_of(const H5Shape& shape) {
  std::size_t count = 1;
  for (std::size_t side : shape) {
    if (side != 0 && count > (std::size_t{1} << 40) / side) throw H5Failure("an array is impossibly large");
    count *= side;
  }
  return count;
}

H5Group::H5Group(H5Group&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)) {}
H5Group::~H5Group() {
  if (id_ >= 0) H5Gclose(id_);
}

H5Group H5Group::create_group(const std::string& name, std::string_view nx_class) {
  Handle made(H5Gcreate2(id_, name.c_str(), H5P_DEFAULT, timeless(H5P_GROUP_CREATE), H5P_DEFAULT), H5Gclose,
              concat("creating group '", name, "'"));
  H5Group group(made.release());
  if (!nx_class.empty()) group.set_text("NX_class", nx_class);
  return group;
}

H5Group H5Group::group(const std::string& name) const {
  return H5Group(
      Handle(H5Gopen2(id_, name.c_str(), H5P_DEFAULT), H5Gclose, concat("opening group '", name, "'"))
          .release());
}

bool H5Group::has(const std::string& name) const {
  return H5Lexists(id_, name.c_str(), H5P_DEFAULT) > 0;
}

std::vector<std::string> H5Group::names() const {
  std::vector<std::string> names;
  const auto collect = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  check(H5Literate(id_, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &names), "listing a group");
  return names;
}

void H5Group::set_text(const std::string& name, std::string_view text, const std::string& dataset) {
  const Handle type = text_type(text.size(), is_ascii(text));
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose, "making a data space");
  const std::string bytes = text.empty() ? std::string(1, '\0') : std::string(text);
  if (dataset.empty()) return write_attribute(id_, name, type, type, space, bytes.data());
  write_attribute(open_dataset(id_, dataset), name, type, type, space, bytes.data());
}

void H5Group::set_texts(const std::string& name, const std::vector<std::string>& texts) {
  const PackedTexts pack = packed(texts);
  const Handle type = text_type(pack.width, pack.ascii);
  write_attribute(id_, name, type, type, simple_space({texts.size()}), pack.bytes.data());
}

void H5Group::set_reals(const std::string& name, std::span<const double> values) {
  write_attribute(id_, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, simple_space({values.size()}), values.data());
}

void H5Group::set_integers(const std::string& name, std::span<const std::int64_t> values) {
  write_attribute(id_, name, H5T_STD_I64LE, H5T_NATIVE_INT64, simple_space({values.size()}), values.data());
}

std::string H5Group::text(const std::string& name) const {
  return read_text_attribute(id_, name);
}
std::string H5Group::text_of_dataset(const std::string& dataset, const std::string& name) const {
  return read_text_attribute(open_dataset(id_, dataset), name);
}
std::vector<double> H5Group::reals(const std::string& name) const {
  return read_attribute<double>(id_, name, H5T_NATIVE_DOUBLE);
}
std::vector<std::int64_t> H5Group::integers(const std::string& name) const {
  return read_attribute<std::int64_t>(id_, name, H5T_NATIVE_INT64);
}

std::map<std::string, std::string> H5Group::all_texts() const {
  std::vector<std::string> names;
  const auto collect = [](hid_t, const char* name, const H5A_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  check(H5Aiterate2(id_, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &names), "listing attributes");
  std::map<std::string, std::string> texts;
  for (const std::string& name : names) texts[name] = text(name);
  return texts;
}

void H5Group::create(const std::string& name, H5Number number, const H5Shape& shape, H5Layout layout) {
  const Handle plist = timeless(H5P_DATASET_CREATE);
  if (layout != H5Layout::Contiguous && count_of(shape) > 0) {
    std::vector<hsize_t> chunk(shape.begin(), shape.end());
    chunk[0] = 1;
    check(H5Pset_chunk(plist, static_cast<int>(chunk.size()), chunk.data()), "setting chunks");
    if (layout == H5Layout::Zipped) {
      check(H5Pset_shuffle(plist), "setting a filter");
      check(H5Pset_deflate(plist, 4), "setting a filter");
    }
    check(H5Pset_fletcher32(plist), "setting a filter");
  }
  const Handle dataset(
      H5Dcreate2(id_, name.c_str(), file_type(number), simple_space(shape), H5P_DEFAULT, plist, H5P_DEFAULT),
      H5Dclose, concat("creating dataset '", name, "'"));
}

void H5Group::write_all(const std::string& name, H5Number number, const void* values) {
  check(H5Dwrite(open_dataset(id_, name), memory_type(number), H5S_ALL, H5S_ALL, H5P_DEFAULT, values),
        concat("writing dataset '", name, "'"));
}

void H5Group::read_all(const std::string& name, H5Number number, void* values) const {
  const Handle dataset = open_dataset(id_, name);
  const Handle type(H5Dget_type(dataset), H5Tclose, "reading a type");
  const H5T_class_t kind = H5Tget_class(type);
  if (kind != H5T_INTEGER && kind != H5T_FLOAT)
    throw H5Failure(concat("dataset '", name, "' holds no numbers"));
  check(H5Dread(dataset, memory_type(number), H5S_ALL, H5S_ALL, H5P_DEFAULT, values),
        concat("reading dataset '", name, "'"));
}

void H5Group::write_slice(const std::string& name, std::size_t index, H5Number number, const void* values) {
  const Handle dataset = open_dataset(id_, name);
  Handle memory(H5Screate(H5S_SIMPLE), H5Sclose, "making a data space");
  const Handle space = slice_space(dataset, index, memory);
  check(H5Dwrite(dataset, memory_type(number), memory, space, H5P_DEFAULT, values),
        concat("writing dataset '", name, "'"));
}

void H5Group::read_slice(const std::string& name, std::size_t index, H5Number number, void* values) const {
  const Handle dataset = open_dataset(id_, name);
  Handle memory(H5Screate(H5S_SIMPLE), H5Sclose, "making a data space");
  const Handle space = slice_space(dataset, index, memory);
  check(H5Dread(dataset, memory_type(number), memory, space, H5P_DEFAULT, values),
        concat("reading dataset '", name, "'"));
}

// A damaged header may promise any shape. What is stored bounds it: gzip expands 1032-fold at most.
H5Shape H5Group::checked_shape(const std::string& name) const {
  const Handle dataset = open_dataset(id_, name);
  const Handle space(H5Dget_space(dataset), H5Sclose, "reading a shape");
  const Handle type(H5Dget_type(dataset), H5Tclose, "reading a type");
  const Handle plist(H5Dget_create_plist(dataset), H5Pclose, "reading a property list");
  const H5Shape shape = shape_of(space);
  const Handle file(H5Iget_file_id(dataset), H5Fclose, "finding the file");
  hsize_t file_bytes = 0;
  check(H5Fget_filesize(file, &file_bytes), "reading the file's size");
  const std::size_t stored = std::min<hsize_t>(H5Dget_storage_size(dataset), file_bytes);
  const std::size_t most = H5Pget_nfilters(plist) > 0 ? stored * 1040 : stored;
  if (count_of(shape) > most / std::max<std::size_t>(H5Tget_size(type), 1))
    throw H5Failure(concat("dataset '", name, "' is cut short"));
  return shape;
}

void H5Group::write_texts(const std::string& name, const std::vector<std::string>& texts) {
  const PackedTexts pack = packed(texts);
  const Handle type = text_type(pack.width, pack.ascii);
  const Handle dataset(H5Dcreate2(id_, name.c_str(), type, simple_space({texts.size()}), H5P_DEFAULT,
                                  timeless(H5P_DATASET_CREATE), H5P_DEFAULT),
                       H5Dclose, concat("creating dataset '", name, "'"));
  if (texts.empty()) return;
  check(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pack.bytes.data()),
        concat("writing dataset '", name, "'"));
}

std::vector<std::string> H5Group::read_texts(const std::string& name) const {
  const Handle dataset = open_dataset(id_, name);
  const Handle space(H5Dget_space(dataset), H5Sclose, "reading a shape");
  const Handle type(H5Dget_type(dataset), H5Tclose, "reading a type");
  const std::size_t count = count_of(shape_of(space));
  if (count > kMaxText) throw H5Failure(concat("dataset '", name, "' is too long"));
  if (count == 0) return {};
  return texts_of(type, count, [&](hid_t memory, void* out) {
    return H5Dread(dataset, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, out);
  });
}

void H5Group::link(const std::string& name, H5Group& other, const std::string& other_name) {
  check(H5Lcreate_hard(id_, name.c_str(), other.id_, other_name.c_str(), H5P_DEFAULT, H5P_DEFAULT),
        "linking a dataset");
}

H5File H5File::create(const std::filesystem::path& path) {
  be_silent();
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "making a property list");
  check(H5Pset_libver_bounds(access, H5F_LIBVER_V110, H5F_LIBVER_V110), "choosing the format version");
  Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, timeless(H5P_FILE_CREATE), access), H5Fclose,
              "creating the file");
  Handle root(H5Gopen2(file, "/", H5P_DEFAULT), H5Gclose, "opening the root");
  return H5File(file.release(), root.release());
}

H5File H5File::open(const std::filesystem::path& path) {
  be_silent();
  Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose, "opening the file");
  Handle root(H5Gopen2(file, "/", H5P_DEFAULT), H5Gclose, "opening the root");
  return H5File(file.release(), root.release());
}

H5File::H5File(H5File&& other) noexcept
    : H5Group(std::move(other)), file_(std::exchange(other.file_, H5I_INVALID_HID)) {}

H5File::~H5File() {
  if (id_ >= 0) H5Gclose(std::exchange(id_, H5I_INVALID_HID));
  if (file_ >= 0) H5Fclose(file_);
}

void H5File::flush() {
  check(H5Fflush(file_, H5F_SCOPE_GLOBAL), "writing to the disk");
}

}  // namespace flamefield
