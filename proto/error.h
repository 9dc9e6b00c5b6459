#pragma once

#include <sstream>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace flamefield {

// What the caller should do next, not where the error came from.
enum class ErrorCode {
  InvalidInput,  // mend the input or the configuration
  NotFound,      // name something that exists
  Unavailable,   // try again later
  DataLoss,      // drop it and count it
};

struct Error {
  ErrorCode code = ErrorCode::InvalidInput;
  std::string message;  // "<problem> (<why it is one>) <suggestion>"
};

template <class T = void>
using Result = tl::expected<T, Error>;

std::string_view name_of(ErrorCode code);

// Joins any streamable parts into one string.
template <class... Parts>
std::string concat(const Parts&... parts) {
  std::ostringstream out;
  (out << ... << parts);
  return out.str();
}

// The one place where the grammar of an error message is spelt out.
tl::unexpected<Error> failure(ErrorCode code, std::string_view problem, std::string_view why,
                              std::string_view suggestion);

inline tl::unexpected<Error> invalid_input(std::string_view problem, std::string_view why,
                                           std::string_view suggestion) {
  return failure(ErrorCode::InvalidInput, problem, why, suggestion);
}
inline tl::unexpected<Error> not_found(std::string_view problem, std::string_view why,
                                       std::string_view suggestion) {
  return failure(ErrorCode::NotFound, problem, why, suggestion);
}
inline tl::unexpected<Error> unavailable(std::string_view problem, std::string_view why,
                                         std::string_view suggestion) {
  return failure(ErrorCode::Unavailable, problem, why, suggestion);
}
inline tl::unexpected<Error> data_loss(std::string_view problem, std::string_view why,
                                       std::string_view suggestion) {
  return failure(ErrorCode::DataLoss, problem, why, suggestion);
}

}  // namespace flamefield
