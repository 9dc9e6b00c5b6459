#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "proto/message.h"

namespace flamefield {

// Limits on what is believed of outside bytes. Checked before anything of that size is allocated.
inline constexpr std::size_t kMaxHeaderBytes = 4u << 20;
inline constexpr std::size_t kMaxFrameBytes = 256u << 20;
inline constexpr int kMaxCameras = 256;

// The header of a message. Pixels are left out: they travel beside it, see frame_set_of().
std::string encode(const Message& message, std::uint64_t request = 0);

// InvalidInput when the bytes are no message, or when anything in it is out of range: sizes, counts, names
// that could leave a directory, unknown enumerators, numbers that are not finite.
Result<Envelope> decode(std::span<const std::byte> header);

// The frame set that a message carries (PutSet, SetData), or none. Its frames' bytes are the raw parts.
const FrameSet* frame_set_of(const Message& message);
FrameSet* frame_set_of(Message& message);

// Gives the frames of a decoded set their pixels, one part per frame. InvalidInput when number or sizes
// differ.
using Bytes = std::shared_ptr<const std::vector<std::byte>>;
Result<> attach_frames(FrameSet& set, std::vector<Bytes> parts);

}  // namespace flamefield
