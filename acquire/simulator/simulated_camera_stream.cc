// The half of the simulated camera that takes pictures and sends them.
#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <thread>

#include "acquire/pixel_code.h"
#include "acquire/simulator/big_endian.h"
#include "acquire/simulator/registers.h"
#include "acquire/simulator/simulated_camera.h"
#include "proto/utc.h"

namespace flamefield {

namespace {

constexpr std::size_t kMaxOrders = 4;  // pulses that may wait for a busy camera
constexpr std::size_t kHistory = 8;    // frames kept for resend
constexpr std::size_t kBatch = 32;     // packets in one system call
constexpr std::uint32_t kTick_ns = 1'000'000'000 / reg::kTickFrequency_hz;

std::uint64_t hash(std::uint64_t x) {
  x = (x ^ (x >> 31)) * 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 29)) * 0xbf58476d1ce4e5b9ull;
  return x ^ (x >> 32);
}

}  // namespace

std::uint64_t SimulatedCamera::ticks_at(std::int64_t time_ns) const {
  const auto elapsed_ns = static_cast<double>(time_ns - epoch_ns_);
  const auto drift_ns = static_cast<std::int64_t>(elapsed_ns * options_.clock_drift_ppm * 1e-6);
  const std::int64_t device_ns = time_ns - epoch_ns_ + drift_ns + options_.clock_offset_ns;
  return static_cast<std::uint64_t>(std::max<std::int64_t>(device_ns, 0)) / kTick_ns;
}

void SimulatedCamera::trigger(const Pulse& pulse) {
  bool dies = false, revives = false;
  {
    const std::lock_guard lock(mutex_);
    dies = has_power_ && faults_.dies_at_pulse == pulse.number;
    revives = !has_power_ && faults_.revives_at_pulse == pulse.number;
  }
  if (dies || revives) set_power(revives);
  {
    const std::lock_guard lock(mutex_);
    if (!has_power_) return;
    ++counters_.edges;
  }
  count_and_order(pulse, reg::kSourceLine1);
}

// A trigger counts whether or not a picture follows: that is how a client learns of a missed one.
void SimulatedCamera::count_and_order(const Pulse& pulse, std::uint32_t source) {
  if (registers_.get(reg::kTriggerMode) != 1 || registers_.get(reg::kTriggerSource) != source) return;
  {
    const std::lock_guard lock(mutex_);
    registers_.set(reg::kCounterValue, ++trigger_count_);
    const bool is_acquiring = registers_.get(reg::kAcquisition) == 1;
    if (faults_.missed_pulses.contains(pulse.number) || (is_acquiring && orders_.size() >= kMaxOrders)) {
      ++counters_.missed;
      return;
    }
    if (!is_acquiring) return;
    orders_.push_back({pulse, trigger_count_});
  }
  wake_.notify_all();
}

bool SimulatedCamera::is_free_running() const {
  return registers_.get(reg::kAcquisition) == 1 && registers_.get(reg::kTriggerMode) == 0;
}

void SimulatedCamera::run() {
  auto next_free_run = std::chrono::steady_clock::now();
  for (;;) {
    Order order;
    {
      std::unique_lock lock(mutex_);
      const auto has_work = [this] { return quit_ || !orders_.empty(); };
      if (is_free_running()) {
        const auto period = std::chrono::microseconds(registers_.get(reg::kFramePeriod));
        next_free_run = std::max(next_free_run + period, std::chrono::steady_clock::now());
        if (!wake_.wait_until(lock, next_free_run, has_work)) {
          if (!has_power_ || !is_free_running()) continue;
          orders_.push_back({{.number = 0, .index = 0, .time_ns = utc_now_ns()}, trigger_count_});
        }
      } else {
        wake_.wait(lock, [&] { return has_work() || is_free_running(); });
      }
      if (quit_) return;
      if (orders_.empty()) continue;
      order = orders_.front();
      orders_.pop_front();
    }
    const std::shared_ptr<const StreamFrame> frame = take_picture(order);
    if (frame) send(*frame);
  }
}

std::shared_ptr<StreamFrame> SimulatedCamera::take_picture(const Order& order) {
  const auto value = [this](std::uint32_t address) { return static_cast<int>(registers_.get(address)); };
  Sensor::Readout readout;
  readout.format = pixel_format_from_code(registers_.get(reg::kPixelFormat)).value_or(PixelFormat::Mono8);
  readout.width_px = value(reg::kWidth);
  readout.height_px = value(reg::kHeight);
  readout.offset_x_px = std::min(value(reg::kOffsetX), options_.width_px - readout.width_px);
  readout.offset_y_px = std::min(value(reg::kOffsetY), options_.height_px - readout.height_px);
  readout.exposure_us = value(reg::kExposure);
  readout.gain_raw = value(reg::kGainRaw);
  readout.black_level_raw = value(reg::kBlackLevelRaw);

  auto frame = std::make_shared<StreamFrame>();
  frame->pulse = order.pulse.number;
  frame->timestamp = ticks_at(order.pulse.time_ns);
  frame->pixel_format = registers_.get(reg::kPixelFormat);
  frame->width_px = static_cast<std::uint32_t>(readout.width_px);
  frame->height_px = static_cast<std::uint32_t>(readout.height_px);
  frame->offset_x_px = static_cast<std::uint32_t>(readout.offset_x_px);
  frame->offset_y_px = static_cast<std::uint32_t>(readout.offset_y_px);
  frame->packet_payload = (registers_.get(reg::kPacketSize) & 0xffff) - kStreamOverhead;
  const Scene scene = scene_();
  const std::shared_ptr<const Image> light = scene ? scene(options_.number, order.pulse) : nullptr;
  frame->payload = sensor_.expose(light.get(), readout, order.pulse.number);

  const std::lock_guard lock(mutex_);
  if (!has_power_ || registers_.get(reg::kAcquisition) != 1) return nullptr;
  last_frame_id_ = static_cast<std::uint16_t>(last_frame_id_ == 65535 ? 1 : last_frame_id_ + 1);
  frame->frame_id = last_frame_id_;
  append_chunks(*frame, order);
  ++counters_.frames;
  history_.push_back(frame);
  if (history_.size() > kHistory) history_.pop_front();
  return frame;
}

void SimulatedCamera::append_chunks(StreamFrame& frame, const Order& order) const {
  frame.has_chunks = registers_.get(reg::kChunkMode) == 1;
  if (!frame.has_chunks) return;
  std::vector<std::uint8_t>& payload = frame.payload;
  const auto image_size = static_cast<std::uint32_t>(payload.size());
  append_u32(payload, reg::kChunkImageId);
  append_u32(payload, image_size);
  const std::array<std::uint32_t, 3> ids = {reg::kChunkFramecounterId, reg::kChunkTriggerinputcounterId,
                                            reg::kChunkTimestampId};
  for (std::uint32_t i = 0; i < ids.size(); ++i) {
    if (registers_.get(reg::kChunkEnable + i * reg::kChunkSelectorStride) != 1) continue;
    std::vector<std::uint8_t> data;
    if (i == 0) append_u32(data, frame.frame_id - 1u);
    if (i == 1) append_u32(data, order.trigger_count);
    if (i == 2) append_u64(data, frame.timestamp);
    append_chunk(payload, ids[i], data);
  }
}

bool SimulatedCamera::is_dropped(const StreamFrame& frame, std::uint32_t packet,
                                 std::uint64_t attempt) const {
  if (faults_.lost_frames.contains(frame.pulse)) return true;
  if (packet == 0 && faults_.lost_leaders.contains(frame.pulse)) return true;
  if (faults_.packet_loss <= 0) return false;
  const auto pulse = static_cast<std::uint64_t>(frame.pulse);
  const std::uint64_t bits =
      hash(hash(hash(hash(options_.seed + options_.number) + pulse) + packet) + attempt);
  return static_cast<double>(bits >> 11) * 0x1p-53 < faults_.packet_loss;
}

sockaddr_in SimulatedCamera::stream_destination() const {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(registers_.get(reg::kStreamPort)));
  to.sin_addr.s_addr = htonl(registers_.get(reg::kStreamAddress));
  return to;
}

void SimulatedCamera::send(const StreamFrame& frame) {
  sockaddr_in to = stream_destination();
  if (to.sin_port == 0) return;
  const auto sleep_ticks = [](std::uint64_t ticks) {
    if (ticks > 0) std::this_thread::sleep_for(std::chrono::nanoseconds(ticks * kTick_ns));
  };
  sleep_ticks(registers_.get(reg::kTransmissionDelay));
  const std::uint32_t packet_delay = registers_.get(reg::kPacketDelay);
  std::array<std::vector<std::uint8_t>, kBatch> packets;
  std::array<mmsghdr, kBatch> messages{};
  std::array<iovec, kBatch> parts{};
  for (std::uint32_t packet = 0; packet < frame.packets();) {
    unsigned filled = 0;
    {
      const std::lock_guard lock(mutex_);
      if (!has_power_) return;
      for (; packet < frame.packets() && filled < kBatch; ++packet) {
        ++counters_.packets;
        if (is_dropped(frame, packet, 0)) {
          ++counters_.dropped;
          continue;
        }
        encode_packet(frame, packet, packets[filled]);
        parts[filled] = {packets[filled].data(), packets[filled].size()};
        messages[filled] = {};
        messages[filled].msg_hdr.msg_name = &to;
        messages[filled].msg_hdr.msg_namelen = sizeof to;
        messages[filled].msg_hdr.msg_iov = &parts[filled];
        messages[filled].msg_hdr.msg_iovlen = 1;
        ++filled;
      }
    }
    for (unsigned sent = 0; sent < filled;) {
      const int n = ::sendmmsg(stream_socket_, messages.data() + sent, filled - sent, 0);
      if (n <= 0) break;  // nobody listens: a real camera would not know either
      sent += static_cast<unsigned>(n);
    }
    sleep_ticks(std::uint64_t{packet_delay} * filled);
  }
}

void SimulatedCamera::resend(const ResendRequest& request) {
  const sockaddr_in to = stream_destination();
  const std::lock_guard lock(mutex_);
  if (!faults_.answers_resend || to.sin_port == 0) return;
  const auto found = std::find_if(history_.rbegin(), history_.rend(),
                                  [&](const auto& frame) { return frame->frame_id == request.frame_id; });
  std::vector<std::uint8_t> packet;
  const auto send_one = [&] {
    ::sendto(stream_socket_, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to),
             sizeof to);
  };
  if (found == history_.rend() || request.last_packet >= (*found)->packets()) {
    encode_unavailable(request.frame_id, request.first_packet, packet);
    return send_one();
  }
  for (std::uint32_t i = request.first_packet; i <= request.last_packet; ++i) {
    if (is_dropped(**found, i, ++resend_attempts_)) {
      ++counters_.dropped;
      continue;
    }
    encode_packet(**found, i, packet);
    send_one();
    ++counters_.resent;
  }
}

void SimulatedCamera::send_test_packet(std::uint32_t packet_size) {
  const sockaddr_in to = stream_destination();
  if (to.sin_port == 0) return;
  const std::vector<std::uint8_t> packet(packet_size - 28, 0);  // without IP and UDP headers
  ::sendto(stream_socket_, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to),
           sizeof to);
}

}  // namespace flamefield
