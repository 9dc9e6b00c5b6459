#include "acquire/aravis_device.h"

#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "acquire/aravis_handles.h"
#include "acquire/discovery.h"
#include "acquire/pixel_code.h"
#include "proto/check.h"
#include "proto/utc.h"

namespace flamefield {

namespace {

using Bytes = std::shared_ptr<std::vector<std::byte>>;

constexpr std::uint32_t kTimestampControl = 0x0944;  // GigE Vision 2.0, bootstrap registers
constexpr std::uint32_t kTimestampHigh = 0x0948;
constexpr std::uint32_t kTimestampLow = 0x094c;
constexpr int kClockReadings = 5;
constexpr std::chrono::milliseconds kDiscoveryTimeout{600};

// Aravis 0.8 enlarges the socket's buffer only when the first packet is there, too late for the first frame.
// The socket is its own; we know it by its port.
void enlarge_socket_buffer(int port, int bytes) {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", ignored)) {
    const std::string name = entry.path().filename().string();
    int fd = -1;
    std::from_chars(name.data(), name.data() + name.size(), fd);
    sockaddr_in local{};
    socklen_t length = sizeof local;
    if (fd < 0 || ::getsockname(fd, reinterpret_cast<sockaddr*>(&local), &length) != 0) continue;
    if (local.sin_family != AF_INET || ntohs(local.sin_port) != port) continue;
    // Beyond the system's limit where we may, else up to it.
    if (::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0) {
      ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    }
  }
}

LossCause cause_of(ArvBufferStatus status) {
  switch (status) {
    case ARV_BUFFER_STATUS_SIZE_MISMATCH:
    case ARV_BUFFER_STATUS_WRONG_PACKET_ID:
    case ARV_BUFFER_STATUS_UNKNOWN:
      return LossCause::Corrupt;
    default:
      return LossCause::Incomplete;
  }
}

}  // namespace

AravisDevice::AravisDevice(std::unique_ptr<Handles> handles) : handles_(std::move(handles)) {}

AravisDevice::~AravisDevice() = default;

Result<std::unique_ptr<AravisDevice>> AravisDevice::open(const CameraAddress& address) {
  auto handles = std::make_unique<Handles>();
  handles->address = address;
  // Aravis waits for silent cameras one after the other, under the lock; ask first.
  const auto found = discover_at(address.address, kDiscoveryTimeout);
  if (!found) {
    return unavailable(concat("camera ", address.name, " at ", address.address), "it does not answer",
                       "check its power, cable and address");
  }
  if (!address.serial.empty() && found->serial != address.serial) {
    return unavailable(
        concat("camera ", address.name, " at ", address.address, " has serial number ", found->serial),
        concat(address.serial, " is expected there"), "check whether cables or addresses were swapped");
  }
  ArvError error;
  {
    const std::lock_guard lock(genicam_parser);
    handles->camera = arv_camera_new(address.address.c_str(), error.out());
  }
  if (!handles->camera) return handles->failed("cannot be opened", error);
  ArvDevice* device = arv_camera_get_device(handles->camera);
  if (!arv_camera_is_gv_device(handles->camera)) {
    return invalid_input(concat("camera ", address.name, " at ", address.address),
                         "is not a GigE Vision camera", "give the IP address of one");
  }
  if (!arv_gv_device_is_controller(ARV_GV_DEVICE(device))) {
    return unavailable(concat("camera ", address.name, " at ", address.address, " refuses control"),
                       "another program has it", "close that program, or wait for its heartbeat to expire");
  }
  g_signal_connect(device, "control-lost", G_CALLBACK(+[](ArvDevice*, gpointer lost) {
                     *static_cast<std::atomic<bool>*>(lost) = true;
                   }),
                   &handles->is_lost);
  std::unique_ptr<AravisDevice> out(new AravisDevice(std::move(handles)));
  out->serial_ = found->serial;
  return out;
}

Result<> AravisDevice::open_stream() {
  expect(payload_bytes_ > 0, "apply() comes before open_stream()");
  ArvCamera* camera = handles_->camera;
  ArvError error;
  g_clear_object(&handles_->stream);
  // Raw packet sockets need root and 32 MiB a camera.
  arv_camera_gv_set_stream_options(camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  handles_->stream = arv_camera_create_stream(camera, nullptr, nullptr, error.out());
  if (!handles_->stream) return handles_->failed("no stream", error);
  // The default ratio of 0.25 gives frames up that lost more than a quarter of their packets in a row.
  g_object_set(handles_->stream, "packet-request-ratio", 1.0, "socket-buffer",
               ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size", -1, nullptr);
  enlarge_socket_buffer(arv_gv_stream_get_port(ARV_GV_STREAM(handles_->stream)),
                        settings_.socket_buffer_bytes);
  for (int i = 0; i < settings_.buffers; ++i) push_buffer();
  underruns_ = 0;
  anchor_clock();
  return {};
}

// The bytes belong to whoever holds the frame last; Aravis only fills them.
void AravisDevice::push_buffer() {
  auto* holder = new Bytes(pool_.take(payload_bytes_));
  arv_stream_push_buffer(handles_->stream,
                         arv_buffer_new_full(payload_bytes_, (*holder)->data(), holder,
                                             [](void* p) { delete static_cast<Bytes*>(p); }));
}

Result<> AravisDevice::start() {
  ArvError error;
  arv_camera_start_acquisition(handles_->camera, error.out());
  if (error.happened()) return handles_->failed("does not start", error);
  return {};
}

void AravisDevice::stop() {
  arv_camera_stop_acquisition(handles_->camera, nullptr);
}

StreamStatistics AravisDevice::close_stream() {
  StreamStatistics out;
  if (!handles_->stream) return out;
  guint64 completed = 0, failures = 0, underruns = 0, resent = 0, missing = 0;
  arv_stream_get_statistics(handles_->stream, &completed, &failures, &underruns);
  arv_gv_stream_get_statistics(ARV_GV_STREAM(handles_->stream), &resent, &missing);
  out.completed_frames = static_cast<std::int64_t>(completed);
  out.failed_frames = static_cast<std::int64_t>(failures);
  out.underruns = static_cast<std::int64_t>(underruns);
  out.resent_packets = static_cast<std::int64_t>(resent);
  out.missing_packets = static_cast<std::int64_t>(missing);
  g_clear_object(&handles_->stream);
  return out;
}

std::optional<std::int64_t> AravisDevice::trigger_count() {
  if (!has_counter_) return std::nullopt;
  ArvError error;
  const gint64 count = arv_camera_get_integer(handles_->camera, "CounterValue", error.out());
  if (error.happened()) return std::nullopt;
  return count;
}

bool AravisDevice::reset_trigger_count() {
  if (!has_counter_) return false;
  ArvError error;
  arv_camera_execute_command(handles_->camera, "CounterReset", error.out());
  return !error.happened();
}

Result<> AravisDevice::software_trigger() {
  ArvError error;
  arv_camera_software_trigger(handles_->camera, error.out());
  if (error.happened()) return handles_->failed("software trigger", error);
  return {};
}

// Offset between the clocks by Cristian's method: the device's time lies between our two readings around it;
// the tightest of a few tries counts (Cristian, Distributed Computing 3, 1989).
void AravisDevice::anchor_clock() {
  clock_offset_ns_.reset();
  is_clock_anchored_ = false;
  ArvDevice* device = arv_camera_get_device(handles_->camera);
  const double frequency_hz = handles_->tick_frequency_hz();
  if (!(frequency_hz > 0)) return;
  std::int64_t best_ns = std::numeric_limits<std::int64_t>::max();
  for (int i = 0; i < kClockReadings; ++i) {
    const std::int64_t before_ns = utc_now_ns();
    if (!arv_device_write_register(device, kTimestampControl, 2, nullptr)) return;
    const std::int64_t after_ns = utc_now_ns();
    guint32 high = 0, low = 0;
    if (!arv_device_read_register(device, kTimestampHigh, &high, nullptr) ||
        !arv_device_read_register(device, kTimestampLow, &low, nullptr)) {
      return;
    }
    const auto ticks = static_cast<double>(std::uint64_t{high} << 32 | low);
    if (ticks <= 0 || after_ns - before_ns >= best_ns) continue;
    best_ns = after_ns - before_ns;
    clock_error_ns_ = best_ns / 2;
    clock_offset_ns_ = before_ns + best_ns / 2 - std::llround(ticks / frequency_hz * 1e9);
    is_clock_anchored_ = true;
  }
}

// Without an anchor, the fastest frame so far tells most about the offset.
std::int64_t AravisDevice::utc_of(std::int64_t device_time_ns, std::int64_t arrival_ns) {
  if (!is_clock_anchored_) {
    const std::int64_t offset_ns = arrival_ns - device_time_ns;
    clock_offset_ns_ = std::min(clock_offset_ns_.value_or(offset_ns), offset_ns);
  }
  return device_time_ns + *clock_offset_ns_;
}

std::optional<std::variant<Arrival, LossCause>> AravisDevice::next(std::chrono::microseconds timeout) {
  expect(handles_->stream != nullptr, "the stream is open");
  ArvBuffer* buffer = arv_stream_timeout_pop_buffer(handles_->stream, static_cast<guint64>(timeout.count()));
  if (!buffer) {
    guint64 underruns = 0;
    arv_stream_get_statistics(handles_->stream, nullptr, nullptr, &underruns);
    if (static_cast<std::int64_t>(underruns) == underruns_) return std::nullopt;
    underruns_ = static_cast<std::int64_t>(underruns);
    return LossCause::NoBuffer;
  }
  push_buffer();
  const std::int64_t now_ns = utc_now_ns();
  const std::unique_ptr<ArvBuffer, void (*)(ArvBuffer*)> owner(buffer,
                                                               [](ArvBuffer* b) { g_object_unref(b); });
  const ArvBufferStatus status = arv_buffer_get_status(buffer);
  // Ids and times of an unsuccessful buffer are those of an earlier frame.
  if (status != ARV_BUFFER_STATUS_SUCCESS) return cause_of(status);

  // Only pictures have a size to ask for.
  if (arv_buffer_get_payload_type(buffer) != ARV_BUFFER_PAYLOAD_TYPE_IMAGE) return LossCause::Corrupt;

  Arrival arrival;
  Frame& frame = arrival.frame;
  frame.camera = handles_->address.name;
  frame.device_time_ns = static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer));
  frame.arrival_time_ns = now_ns;
  frame.exposure_us = settings_.exposure_us;
  frame.width_px = arv_buffer_get_image_width(buffer);
  frame.height_px = arv_buffer_get_image_height(buffer);
  const auto format = pixel_format_from_code(arv_buffer_get_image_pixel_format(buffer));
  std::size_t size = 0;
  arv_buffer_get_data(buffer, &size);
  if (!format || size < bytes_of_image(*format, frame.width_px, frame.height_px)) return LossCause::Corrupt;
  frame.format = *format;
  const Bytes& bytes = *static_cast<const Bytes*>(arv_buffer_get_user_data(buffer));
  if (has_counter_) {
    ArvError error;
    const gint64 count =
        arv_chunk_parser_get_integer_value(handles_->chunks, buffer, "ChunkTriggerinputcounter", error.out());
    if (error.happened()) return LossCause::Corrupt;
    arrival.trigger_count = count;
  }
  if (has_exposure_) {
    ArvError error;
    const gint64 exposure_us =
        arv_chunk_parser_get_integer_value(handles_->chunks, buffer, "ChunkExposureTime", error.out());
    if (!error.happened() && exposure_us > 0 && exposure_us < 100'000'000) {
      frame.exposure_us = static_cast<int>(exposure_us);
    }
  }
  bytes->resize(bytes_of_image(*format, frame.width_px, frame.height_px));  // without the chunks
  frame.bytes = bytes;
  arrival.exposure_utc_ns = utc_of(frame.device_time_ns, now_ns);
  arrival.clock_error_ns = is_clock_anchored_ ? clock_error_ns_ : 0;
  return arrival;
}

bool AravisDevice::is_lost() const {
  return handles_->is_lost;
}

}  // namespace flamefield
