#pragma once

#include <cstdint>
#include <span>

// The decoders of bytes from outside, each as a function that any bytes may be thrown at. It ends the program
// when a decoder takes what it must refuse; the sanitizers end it when it reads beyond. libFuzzer drives them
// in programs of their own (preset `fuzz`), a test drives them with changed examples in every build.
namespace flamefield::fuzz {

using Bytes = std::span<const std::uint8_t>;

// The header of a message on the bus, decoded; what is accepted is encoded and decoded again.
void bus_message(Bytes bytes);

// A segment of the spool, as a crash, a disk or a person may leave it. The checksum of the first record is
// set right, so that what lies behind it is reached too.
void spool_segment(Bytes bytes);

// The chunks behind a camera's picture. The packets that carry them are sound: Debian's Aravis (0.8.26)
// writes outside of its own buffers, and asks for 60 GB of memory, where their headers are not.
void gvsp_chunks(Bytes bytes);

}  // namespace flamefield::fuzz
