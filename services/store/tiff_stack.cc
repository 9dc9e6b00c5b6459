#include <tiffio.h>

#include <cstring>
#include <memory>

#include "services/store/file.h"
#include "services/store/volume_formats.h"

namespace flamefield {

namespace {

using Tiff = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

int ignore_message(TIFF*, void*, const char*, const char*, va_list) {
  return 1;
}

Tiff open_tiff(const std::filesystem::path& path, const char* mode) {
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                 &TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), ignore_message, nullptr);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignore_message, nullptr);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), tmsize_t{1} << 30);
  return Tiff(TIFFOpenExt(path.c_str(), mode, options.get()), &TIFFClose);
}

tl::unexpected<Error> bad(const std::filesystem::path& path, std::string_view why) {
  return invalid_input(concat("cannot read '", path.string(), "'"), why,
                       "save it as a stack of equal grey pages");
}

struct Page {
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 0, samples = 1, format = SAMPLEFORMAT_UINT;
};

Page page_of(TIFF* tiff) {
  Page page;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &page.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &page.height);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &page.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &page.samples);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &page.format);
  return page;
}

bool is_supported(const Page& page) {
  const bool real = page.format == SAMPLEFORMAT_IEEEFP && page.bits == 32;
  const bool whole = page.format == SAMPLEFORMAT_UINT && (page.bits == 8 || page.bits == 16);
  return page.samples == 1 && (real || whole);
}

void append_row(const Page& page, const std::vector<unsigned char>& row, std::vector<float>& values) {
  for (std::uint32_t x = 0; x < page.width; ++x) {
    if (page.bits == 32) {
      float value = 0;
      std::memcpy(&value, &row[4 * std::size_t{x}], 4);
      values.push_back(value);
    } else if (page.bits == 16) {
      std::uint16_t value = 0;
      std::memcpy(&value, &row[2 * std::size_t{x}], 2);
      values.push_back(value);
    } else {
      values.push_back(row[x]);
    }
  }
}

bool write_page(TIFF* tiff, const TiffStack& stack, std::size_t page) {
  const auto width = static_cast<std::uint32_t>(stack.width_px);
  const auto height = static_cast<std::uint32_t>(stack.height_px);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, height);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 32);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, height);
  if (page == 0) TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, stack.description.c_str());
  const std::size_t pixels = std::size_t{width} * height;
  std::vector<float> copy(stack.values.begin() + static_cast<std::ptrdiff_t>(page * pixels),
                          stack.values.begin() + static_cast<std::ptrdiff_t>((page + 1) * pixels));
  const auto bytes = static_cast<tmsize_t>(pixels * sizeof(float));
  return TIFFWriteEncodedStrip(tiff, 0, copy.data(), bytes) == bytes && TIFFWriteDirectory(tiff) == 1;
}

}  // namespace

Result<TiffStack> read_tiff_stack(const std::filesystem::path& path) {
  auto file = open_input(path);
  if (!file) return tl::unexpected(file.error());
  const Tiff tiff = open_tiff(path, "rm");
  if (!tiff) return bad(path, "not a TIFF file, or cut short");
  TiffStack stack;
  do {
    const Page page = page_of(tiff.get());
    if (!is_supported(page)) return bad(path, "pages must hold one float32, uint8 or uint16 a pixel");
    if (stack.pages > 0 && (page.width != static_cast<std::uint32_t>(stack.width_px) ||
                            page.height != static_cast<std::uint32_t>(stack.height_px))) {
      return bad(path, "its pages differ in size");
    }
    // A damaged header may promise any size; compressed pages expand 1032-fold at most.
    if (page.width == 0 || page.height == 0 || page.width > (1u << 20) || page.height > (1u << 20) ||
        std::uint64_t{page.width} * page.height > file->size_bytes * 1040) {
      return bad(path, "its pages are larger than the file can hold");
    }
    stack.width_px = static_cast<int>(page.width);
    stack.height_px = static_cast<int>(page.height);
    if (stack.pages == 0) {
      const char* description = nullptr;
      if (TIFFGetField(tiff.get(), TIFFTAG_IMAGEDESCRIPTION, &description) == 1 && description)
        stack.description = description;
    }
    const tmsize_t row_bytes = TIFFScanlineSize(tiff.get());
    if (TIFFIsTiled(tiff.get()) ||
        row_bytes < static_cast<tmsize_t>(std::uint64_t{page.width} * page.bits / 8))
      return bad(path, "its pages are tiled or damaged");
    std::vector<unsigned char> row(static_cast<std::size_t>(row_bytes));
    for (std::uint32_t y = 0; y < page.height; ++y) {
      if (TIFFReadScanline(tiff.get(), row.data(), y) != 1) return bad(path, "it is cut short or damaged");
      append_row(page, row, stack.values);
    }
    ++stack.pages;
  } while (TIFFReadDirectory(tiff.get()) == 1);
  return stack;
}

Result<> write_tiff_stack(const std::filesystem::path& path, const TiffStack& stack) {
  auto target = AtomicFile::create(path);
  if (!target) return tl::unexpected(target.error());
  bool good = true;
  {
    const Tiff tiff = open_tiff(target->temporary_path(), "w8");
    good = tiff != nullptr;
    for (std::size_t page = 0; good && page < stack.pages; ++page) good = write_page(tiff.get(), stack, page);
  }
  if (!good) {
    return invalid_input(concat("cannot write '", path.string(), "'"), "the disk refused the data",
                         "free disk space or choose another output");
  }
  return target->commit();
}

}  // namespace flamefield
