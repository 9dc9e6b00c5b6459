#pragma once

#include <initializer_list>
#include <string>
#include <string_view>

#include "proto/error.h"

namespace flamefield {

enum class LogLevel { Debug, Info, Warning, Error };

// One piece of an event: key=value, any streamable value.
struct LogField {
  template <class Value>
  LogField(std::string_view k, const Value& v) : key(k), value(concat(v)) {}
  std::string_view key;
  std::string value;
};

// One line an event on stderr, e.g.
//   2026-03-01T10:15:00.123Z info job-leased job=12 worker="a b"
// Thread-safe. Only services log.
void log_event(LogLevel level, std::string_view event, std::initializer_list<LogField> fields = {});

// Less important events are dropped; Info until told otherwise.
void set_log_level(LogLevel level);

}  // namespace flamefield
