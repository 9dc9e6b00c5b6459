#include "proto/codec.h"

namespace flamefield {

FrameSet* frame_set_of(Message& message) {
  if (auto* put = std::get_if<PutSet>(&message)) return &put->set;
  if (auto* data = std::get_if<SetData>(&message)) return &data->set;
  return nullptr;
}

const FrameSet* frame_set_of(const Message& message) {
  return frame_set_of(const_cast<Message&>(message));
}

Result<> attach_frames(FrameSet& set, std::vector<Bytes> parts) {
  bool fits = parts.size() == set.frames.size();
  for (std::size_t i = 0; fits && i < parts.size(); ++i) {
    const Frame& frame = set.frames[i];
    fits = parts[i] && parts[i]->size() == bytes_of_image(frame.format, frame.width_px, frame.height_px);
  }
  if (!fits) {
    return invalid_input(concat("set ", set.index, " of ", set.capture),
                         "its pixels do not match what its header announces", "send it again");
  }
  for (std::size_t i = 0; i < parts.size(); ++i) set.frames[i].bytes = std::move(parts[i]);
  return {};
}

}  // namespace flamefield
