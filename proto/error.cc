#include "proto/error.h"

namespace flamefield {

std::string_view name_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::InvalidInput:
      return "invalid input";
    case ErrorCode::NotFound:
      return "not found";
    case ErrorCode::Unavailable:
      return "unavailable";
    case ErrorCode::DataLoss:
      return "data loss";
  }
  return "unknown";
}

tl::unexpected<Error> failure(ErrorCode code, std::string_view problem, std::string_view why,
                              std::string_view suggestion) {
  return tl::unexpected<Error>(Error{code, concat(problem, " (", why, ") ", suggestion)});
}

}  // namespace flamefield
