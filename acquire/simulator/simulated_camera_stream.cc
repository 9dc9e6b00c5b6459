// The half of the simulated camera that takes pictures and sends them.
#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <set>
#include <thread>
#include <utility>

#include "acquire/pixel_code.h"
#include "acquire/simulator/big_endian.h"
#include "acquire/simulator/registers.h"
#include "acquire/simulator/simulated_camera.h"
#include "proto/utc.h"

namespace flamefield {

namespace {

constexpr std::size_t kMaxOrders = 32;  // pulses that may wait while the machine is busy elsewhere
constexpr std::size_t kHistory = 8;     // frames kept for resend
constexpr std::size_t kBatch = 32;      // packets in one system call
constexpr std::uint32_t kTick_ns = 1'000'000'000 / reg::kTickFrequency_hz;

constexpr std::int64_t kTaiAhead_ns = 37'000'000'000;  // PTP keeps TAI

constexpr std::uint32_t kNoPixelFormat = 0x01080099;  // 8 bits a pixel, of no known meaning

bool is_in(const std::vector<PulseRange>& ranges, std::int64_t pulse) {
  return std::any_of(ranges.begin(), ranges.end(), [&](const PulseRange& r) { return r.contains(pulse); });
}

}  // namespace

bool SimulatedCamera::keeps_network_time() const {
  return options_.has_ptp && registers_.get(reg::kPtpEnable) == 1;
}

std::uint64_t SimulatedCamera::ticks_at(std::int64_t time_ns) const {
  if (keeps_network_time()) return static_cast<std::uint64_t>(time_ns + kTaiAhead_ns) / kTick_ns;
  const auto elapsed_ns = static_cast<double>(time_ns - epoch_ns_);
  const auto drift_ns = static_cast<std::int64_t>(elapsed_ns * options_.clock_drift_ppm * 1e-6);
  const std::int64_t device_ns = time_ns - epoch_ns_ + drift_ns + clock_offset_ns_;
  return static_cast<std::uint64_t>(std::max<std::int64_t>(device_ns, 0)) / kTick_ns;
}

// The other way round; drift is left out, which only unscheduled cameras have.
std::int64_t SimulatedCamera::time_of(std::uint64_t ticks) const {
  const auto device_ns = static_cast<std::int64_t>(ticks) * kTick_ns;
  return keeps_network_time() ? device_ns - kTaiAhead_ns : device_ns - clock_offset_ns_ + epoch_ns_;
}

void SimulatedCamera::follow_power_and_link(std::int64_t pulse) {
  bool cut = false, was_cut = false;
  {
    const std::lock_guard lock(mutex_);
    is_link_cut_ = is_in(faults_.link_cuts, pulse);
    cut = is_in(faults_.power_cuts, pulse);
    was_cut = std::exchange(is_power_cut_, cut);
  }
  if (cut != was_cut) set_power(!cut);
}

void SimulatedCamera::trigger(const Pulse& pulse) {
  follow_power_and_link(pulse.number);
  bool has_stray = false;
  {
    const std::lock_guard lock(mutex_);
    if (!has_power_ || faults_.unseen_pulses.contains(pulse.number)) return;
    ++counters_.edges;
    has_stray = faults_.extra_pulses.contains(pulse.number);
  }
  count_and_order(pulse, reg::kSourceLine1);
  if (!has_stray) return;
  Pulse stray = pulse;
  stray.time_ns += faults_.extra_delay_ns;
  stray.is_stray = true;
  count_and_order(stray, reg::kSourceLine1);
}

// A trigger counts whether or not a picture follows: that is how a client learns of a missed one.
void SimulatedCamera::count_and_order(Pulse pulse, std::uint32_t source) {
  if (registers_.get(reg::kTriggerMode) != 1 || registers_.get(reg::kTriggerSource) != source) return;
  {
    const std::lock_guard lock(mutex_);
    registers_.set(reg::kCounterValue, ++trigger_count_);
    if (source == reg::kSourceAction1) {  // nobody else numbers them
      pulse.number = trigger_count_;
      pulse.index = pulse.number - 1;
    }
    const bool is_acquiring = registers_.get(reg::kAcquisition) == 1;
    const bool is_missed = !pulse.is_stray && faults_.missed_pulses.contains(pulse.number);
    if (is_missed || (is_acquiring && orders_.size() >= kMaxOrders)) {
      ++counters_.missed;
      return;
    }
    if (!is_acquiring) return;
    const std::int64_t delay_ns = std::int64_t{registers_.get(reg::kTriggerDelay)} * 1000;
    orders_.push_back({pulse, trigger_count_, pulse.time_ns + delay_ns});
  }
  wake_.notify_all();
}

bool SimulatedCamera::is_free_running() const {
  return registers_.get(reg::kAcquisition) == 1 && registers_.get(reg::kTriggerMode) == 0;
}

// Waits for the next exposure; none: the camera is going away.
std::optional<SimulatedCamera::Order> SimulatedCamera::next_order() {
  auto next_free_run = std::chrono::steady_clock::now();
  std::unique_lock lock(mutex_);
  for (;;) {
    if (quit_) return std::nullopt;
    if (!orders_.empty()) {
      const std::int64_t wait_ns = orders_.front().exposure_ns - utc_now_ns();
      if (wait_ns <= 0) {
        const Order order = orders_.front();
        orders_.pop_front();
        return order;
      }
      wake_.wait_for(lock, std::chrono::nanoseconds(wait_ns));
    } else if (is_free_running()) {
      const auto period = std::chrono::microseconds(registers_.get(reg::kFramePeriod));
      next_free_run = std::max(next_free_run + period, std::chrono::steady_clock::now());
      const auto is_disturbed = [this] { return quit_ || !orders_.empty() || !is_free_running(); };
      if (!wake_.wait_until(lock, next_free_run, is_disturbed) && has_power_) {
        const std::int64_t now_ns = utc_now_ns();
        return Order{{.number = 0, .index = 0, .time_ns = now_ns}, trigger_count_, now_ns};
      }
    } else {
      wake_.wait(lock);
    }
  }
}

void SimulatedCamera::run() {
  while (const auto order = next_order()) {
    if (auto frame = take_picture(*order)) transmit(std::move(frame));
  }
}

Sensor::Readout SimulatedCamera::readout() const {
  const auto value = [this](std::uint32_t address) { return static_cast<int>(registers_.get(address)); };
  Sensor::Readout readout;
  readout.format = pixel_format_from_code(registers_.get(reg::kPixelFormat)).value_or(PixelFormat::Mono8);
  readout.binning_x = value(reg::kBinningX);
  readout.binning_y = value(reg::kBinningY);
  const int most_x_px = options_.width_px / readout.binning_x,
            most_y_px = options_.height_px / readout.binning_y;
  readout.width_px = std::min(value(reg::kWidth), most_x_px);
  readout.height_px = std::min(value(reg::kHeight), most_y_px);
  readout.offset_x_px = std::min(value(reg::kOffsetX), most_x_px - readout.width_px);
  readout.offset_y_px = std::min(value(reg::kOffsetY), most_y_px - readout.height_px);
  readout.exposure_us = value(reg::kExposure);
  readout.gain_raw = value(reg::kGainRaw);
  readout.black_level_raw = value(reg::kBlackLevelRaw);
  return readout;
}

std::vector<std::uint8_t> SimulatedCamera::expose(const Order& order) {
  const Sensor::Readout how = readout();
  if (registers_.get(reg::kTestImage) == 1) {
    return test_image_.expose(how, {options_.number, order.pulse.number, order.pulse.is_stray});
  }
  const Scene scene = scene_();
  const std::shared_ptr<const Image> light = scene ? scene(options_.number, order.pulse) : nullptr;
  return sensor_.expose(light.get(), how, order.pulse.number);
}

std::shared_ptr<StreamFrame> SimulatedCamera::take_picture(const Order& order) {
  auto frame = std::make_shared<StreamFrame>();
  const Sensor::Readout how = readout();
  frame->pulse = order.pulse.is_stray ? 0 : order.pulse.number;
  frame->timestamp = ticks_at(order.exposure_ns);
  frame->pixel_format = registers_.get(reg::kPixelFormat);
  frame->width_px = static_cast<std::uint32_t>(how.width_px);
  frame->height_px = static_cast<std::uint32_t>(how.height_px);
  frame->offset_x_px = static_cast<std::uint32_t>(how.offset_x_px);
  frame->offset_y_px = static_cast<std::uint32_t>(how.offset_y_px);
  frame->packet_payload = (registers_.get(reg::kPacketSize) & 0xffff) - kStreamOverhead;
  frame->payload = expose(order);

  const std::lock_guard lock(mutex_);
  if (!has_power_ || registers_.get(reg::kAcquisition) != 1) return nullptr;
  if (faults_.corrupt.contains(frame->pulse)) frame->pixel_format = kNoPixelFormat;
  append_chunks(*frame, order);
  ++counters_.frames;
  return frame;
}

void SimulatedCamera::append_chunks(StreamFrame& frame, const Order& order) const {
  frame.has_chunks = registers_.get(reg::kChunkMode) == 1;
  if (!frame.has_chunks) return;
  std::vector<std::uint8_t>& payload = frame.payload;
  const auto image_size = static_cast<std::uint32_t>(payload.size());
  append_u32(payload, reg::kChunkImageId);
  append_u32(payload, image_size);
  for (std::uint32_t i = 0; i < reg::kChunkIds.size(); ++i) {
    if (registers_.get(reg::kChunkEnable + i * reg::kChunkSelectorStride) != 1) continue;
    std::vector<std::uint8_t> data;
    switch (reg::kChunkIds[i]) {
      case reg::kChunkFramecounterId:
        append_u32(data, last_frame_id_);
        break;
      case reg::kChunkTriggerinputcounterId:
        append_u32(data, order.trigger_count);
        break;
      case reg::kChunkTimestampId:
        append_u64(data, frame.timestamp);
        break;
      default:
        append_u32(data, registers_.get(reg::kExposure));
    }
    append_chunk(payload, reg::kChunkIds[i], data);
  }
}

sockaddr_in SimulatedCamera::stream_destination() const {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(registers_.get(reg::kStreamPort)));
  to.sin_addr.s_addr = htonl(registers_.get(reg::kStreamAddress));
  return to;
}

// Numbers the frame, keeps it for resend requests, and sends it: late or twice if a fault says so.
void SimulatedCamera::transmit(std::shared_ptr<StreamFrame> frame) {
  std::int64_t delay_ns = 0;
  int times = 1;
  {
    const std::lock_guard lock(mutex_);
    if (const auto delay = faults_.delayed_ns.find(frame->pulse); delay != faults_.delayed_ns.end()) {
      delay_ns = delay->second;
    }
    if (faults_.repeated.contains(frame->pulse)) times = 2;
  }
  delay_ns += std::int64_t{registers_.get(reg::kTransmissionDelay)} * kTick_ns;
  if (delay_ns > 0) std::this_thread::sleep_for(std::chrono::nanoseconds(delay_ns));
  for (int i = 0; i < times; ++i) {
    if (i > 0) frame = std::make_shared<StreamFrame>(*frame);
    {
      const std::lock_guard lock(mutex_);
      last_frame_id_ = static_cast<std::uint16_t>(last_frame_id_ == 65535 ? 1 : last_frame_id_ + 1);
      frame->frame_id = last_frame_id_;
      history_.push_back(frame);
      if (history_.size() > kHistory) history_.pop_front();
    }
    send(*frame);
  }
}

// Keeps to the line rate and to the packet delay that the client has set.
void SimulatedCamera::pace(std::size_t packets, std::size_t bytes,
                           std::chrono::steady_clock::time_point begin) const {
  double due_ns = static_cast<double>(registers_.get(reg::kPacketDelay) * std::uint64_t{kTick_ns} * packets);
  if (options_.line_rate_bits_per_s > 0) {
    due_ns += 8e9 * static_cast<double>(bytes) / options_.line_rate_bits_per_s;
  }
  if (due_ns > 0) {
    std::this_thread::sleep_until(begin + std::chrono::nanoseconds(static_cast<std::int64_t>(due_ns)));
  }
}

void SimulatedCamera::send(const StreamFrame& frame) {
  sockaddr_in to = stream_destination();
  if (to.sin_port == 0) return;
  std::vector<std::uint32_t> sequence;
  {
    const std::lock_guard lock(mutex_);
    if (!has_power_) return;
    sequence = transmission().sequence(frame);
    const std::int64_t lost =
        frame.packets() - static_cast<std::int64_t>(std::set(sequence.begin(), sequence.end()).size());
    counters_.packets += frame.packets();
    counters_.dropped += lost;
    if (faults_.corrupt.contains(frame.pulse)) {
      ::sendto(stream_socket_, "noise", 5, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    }
  }
  const auto begin = std::chrono::steady_clock::now();
  std::array<std::vector<std::uint8_t>, kBatch> ends;  // leader and trailer, whole
  std::array<std::array<std::uint8_t, 8>, kBatch> headers;
  std::array<std::array<iovec, 2>, kBatch> parts{};
  std::array<mmsghdr, kBatch> messages{};
  std::size_t bytes = 0;
  for (std::size_t next = 0; next < sequence.size();) {
    unsigned filled = 0;
    for (; next < sequence.size() && filled < kBatch; ++next, ++filled) {
      const std::uint32_t packet = sequence[next];
      msghdr& message = messages[filled].msg_hdr;
      message = {};
      message.msg_name = &to;
      message.msg_namelen = sizeof to;
      message.msg_iov = parts[filled].data();
      if (packet == 0 || packet + 1 == frame.packets()) {
        encode_packet(frame, packet, ends[filled]);
        parts[filled][0] = {ends[filled].data(), ends[filled].size()};
        message.msg_iovlen = 1;
      } else {  // the picture is not copied
        headers[filled] = payload_header(frame, packet);
        const auto part = frame.part(packet);
        parts[filled][0] = {headers[filled].data(), headers[filled].size()};
        parts[filled][1] = {const_cast<std::uint8_t*>(part.data()), part.size()};
        message.msg_iovlen = 2;
      }
      bytes += frame.packet_payload + kStreamOverhead;
    }
    for (unsigned sent = 0; sent < filled;) {
      const int n = ::sendmmsg(stream_socket_, messages.data() + sent, filled - sent, 0);
      if (n <= 0) break;  // nobody listens: a real camera would not know either
      sent += static_cast<unsigned>(n);
    }
    pace(next, bytes, begin);
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
    if (transmission().is_lost(**found, i, ++resend_attempts_)) {
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
