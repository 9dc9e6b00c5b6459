#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/capture.h"
#include "proto/message.h"
#include "services/bus/client.h"

namespace flamefield {

// What someone at the burner does, over the bus: captures, looks at sets, submits work, waits for it.
class Operator {
 public:
  static Result<Operator> connect(Bus& bus, const std::string& role, const std::string& acquisition_endpoint,
                                  const std::string& dispatcher_endpoint);

  using Progress = std::function<void(std::int64_t done, std::int64_t total)>;

  // Captures and waits until every set is durable. When `stop` is requested the capture is ended (draining).
  Result<CaptureState> capture(const StartCapture& request, const Progress& progress, std::stop_token stop);

  // All sets of a capture, in order, as stored.
  Result<std::vector<FrameSet>> fetch(const std::string& capture, std::int64_t sets);

  Client& dispatcher() { return dispatcher_; }
  Client& acquisition() { return acquisition_; }

 private:
  Operator(Client acquisition, Client dispatcher)
      : acquisition_(std::move(acquisition)), dispatcher_(std::move(dispatcher)) {}
  Client acquisition_, dispatcher_;
};

}  // namespace flamefield
