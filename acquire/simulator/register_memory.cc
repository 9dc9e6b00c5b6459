#include "acquire/simulator/register_memory.h"

#include <algorithm>

#include "acquire/simulator/big_endian.h"
#include "acquire/simulator/registers.h"
#include "proto/check.h"

namespace flamefield {

RegisterMemory::RegisterMemory(std::string xml) : bytes_(reg::kXml, 0), xml_(std::move(xml)) {}

bool RegisterMemory::read(std::uint32_t address, std::span<std::uint8_t> into) const {
  const std::uint64_t end = std::uint64_t{address} + into.size();
  // Clients read the file in words, so its last one may reach beyond its end.
  const std::uint64_t padded_xml = (xml_.size() + 3) / 4 * 4;
  if (end > reg::kXml + padded_xml) return false;
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < into.size(); ++i) {
    const std::size_t at = address + i;
    const std::size_t in_xml = at - reg::kXml;
    into[i] = at < reg::kXml         ? bytes_[at]
              : in_xml < xml_.size() ? static_cast<std::uint8_t>(xml_[in_xml])
                                     : std::uint8_t{0};
  }
  return true;
}

bool RegisterMemory::write(std::uint32_t address, std::span<const std::uint8_t> bytes) {
  if (std::uint64_t{address} + bytes.size() > bytes_.size()) return false;
  const std::lock_guard lock(mutex_);
  std::copy(bytes.begin(), bytes.end(), bytes_.begin() + address);
  return true;
}

std::uint32_t RegisterMemory::get(std::uint32_t address) const {
  expect(std::uint64_t{address} + 4 <= bytes_.size(), "the register is inside the memory");
  const std::lock_guard lock(mutex_);
  return load_u32(bytes_.data() + address);
}

void RegisterMemory::set(std::uint32_t address, std::uint32_t value) {
  std::vector<std::uint8_t> bytes;
  append_u32(bytes, value);
  expect(write(address, bytes), "the register is inside the memory");
}

void RegisterMemory::set_text(std::uint32_t address, std::size_t size, std::string_view text) {
  std::vector<std::uint8_t> bytes(size, 0);
  std::copy_n(text.begin(), std::min(text.size(), size - 1), bytes.begin());
  expect(write(address, bytes), "the text is inside the memory");
}

}  // namespace flamefield
