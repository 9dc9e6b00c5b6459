#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"

namespace flamefield {

// A thin layer over the HDF5 C library; only h5.cc includes it. Inside this folder a failed call throws
// H5Failure, which h5_result() turns into an Error that names the file. Files are written in the format of
// HDF5 1.10, in which every metadata structure carries a checksum.
class H5Failure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

enum class H5Number { F32, F64, I64, U8, U16 };
template <class T>
inline constexpr H5Number kH5Number = H5Number::F32;
template <>
inline constexpr H5Number kH5Number<double> = H5Number::F64;
template <>
inline constexpr H5Number kH5Number<std::int64_t> = H5Number::I64;
template <>
inline constexpr H5Number kH5Number<std::uint8_t> = H5Number::U8;
template <>
inline constexpr H5Number kH5Number<std::uint16_t> = H5Number::U16;

// Chunks are slices of the first index. Checked: Fletcher-32 sums. Zipped: gzip, bytes shuffled, as well.
enum class H5Layout { Contiguous, Checked, Zipped };

using H5Shape = std::vector<std::size_t>;

class H5Group {
 public:
  H5Group(const H5Group&) = delete;
  H5Group(H5Group&& other) noexcept;
  ~H5Group();

  // NX_class is left out when empty.
  H5Group create_group(const std::string& name, std::string_view nx_class);
  H5Group group(const std::string& name) const;
  bool has(const std::string& name) const;
  std::vector<std::string> names() const;  // of its links, sorted

  // On the group itself, or on its dataset `dataset`. Text is of fixed length.
  void set_text(const std::string& name, std::string_view text, const std::string& dataset = {});
  void set_texts(const std::string& name, const std::vector<std::string>& texts);
  void set_reals(const std::string& name, std::span<const double> values);
  void set_integers(const std::string& name, std::span<const std::int64_t> values);
  std::string text(const std::string& name) const;
  std::string text_of_dataset(const std::string& dataset, const std::string& name) const;
  std::vector<double> reals(const std::string& name) const;
  std::vector<std::int64_t> integers(const std::string& name) const;
  std::map<std::string, std::string> all_texts() const;  // attributes that are text

  template <class T>
  void write(const std::string& name, std::span<const T> values, const H5Shape& shape,
             H5Layout layout = H5Layout::Contiguous) {
    create(name, kH5Number<T>, shape, layout);
    if (!values.empty()) write_all(name, kH5Number<T>, values.data());
  }
  // Reads a whole dataset, converting numbers. Refuses sizes that the file cannot hold.
  template <class T>
  std::vector<T> read(const std::string& name, H5Shape& shape) const {
    shape = checked_shape(name);
    std::vector<T> values(count_of(shape));
    if (!values.empty()) read_all(name, kH5Number<T>, values.data());
    return values;
  }
  // A dataset of (slices, ...) filled or read one slice at a time.
  void create(const std::string& name, H5Number number, const H5Shape& shape, H5Layout layout);
  void write_slice(const std::string& name, std::size_t index, H5Number number, const void* values);
  void read_slice(const std::string& name, std::size_t index, H5Number number, void* values) const;
  H5Shape checked_shape(const std::string& name) const;

  void write_texts(const std::string& name, const std::vector<std::string>& texts);
  std::vector<std::string> read_texts(const std::string& name) const;

  // One more name for the dataset `name` of this group: a hard link.
  void link(const std::string& name, H5Group& other, const std::string& other_name);

  static std::size_t count_of(const H5Shape& shape);

 protected:
  explicit H5Group(std::int64_t id) : id_(id) {}
  void write_all(const std::string& name, H5Number number, const void* values);
  void read_all(const std::string& name, H5Number number, void* values) const;
  std::int64_t id_ = -1;
};

class H5File : public H5Group {
 public:
  static H5File create(const std::filesystem::path& path);
  static H5File open(const std::filesystem::path& path);
  H5File(H5File&& other) noexcept;
  ~H5File();
  void flush();

 private:
  H5File(std::int64_t file, std::int64_t root) : H5Group(root), file_(file) {}
  std::int64_t file_ = -1;
};

// Runs `work` and turns what goes wrong in it into an Error about `path`.
template <class Work>
auto h5_result(const std::filesystem::path& path, std::string_view verb, Work work) -> decltype(work()) {
  const auto refuse = [&](std::string_view why) {
    return invalid_input(
        concat("cannot ", verb, " '", path.string(), "'"), why,
        verb == "read" ? "copy or make the file again" : "free disk space or choose another output");
  };
  try {
    return work();
  } catch (const H5Failure& failure) {
    return refuse(failure.what());
  } catch (const std::bad_alloc&) {
    return refuse("not enough memory for it");
  } catch (const std::length_error&) {
    return refuse("not enough memory for it");
  }
}

}  // namespace flamefield
