#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "services/gateway/http_server.h"

namespace flamefield {

// Who may steer. Reading is open to whoever reaches the port; a command needs the token, and a browser must
// send it from a page of ours.
class Guard {
 public:
  // Pages that are asked for as localhost or 127.x.y.z get the token by themselves: only this machine reaches
  // the port. `public_name` is what a reverse proxy in front is called; a page asked for by that name gets
  // the token by being opened as /?token=TOKEN once. Empty: there is none.
  explicit Guard(std::string token, std::string public_name = {})
      : token_(std::move(token)), public_name_(std::move(public_name)) {}

  // The refusal of a request that must not be answered at all: addressed to a name that is not ours (a
  // foreign page whose name was made to point here, "DNS rebinding"), or sent by a page of somebody else.
  std::optional<HttpResponse> refuse(const HttpRequest& request) const;

  // The refusal of a command without the right token or as a plain form could send it.
  std::optional<HttpResponse> refuse_command(const HttpRequest& request) const;

  // Set-Cookie for the page, if it may have the token.
  std::optional<std::string> cookie_for(const HttpRequest& page) const;

 private:
  std::string cookie_name(const HttpRequest& request) const;
  std::string token_, public_name_;
};

// The token in `file`, made at random and readable by its owner only when there is none yet.
Result<std::string> token_in(const std::filesystem::path& file);

// The value of `name` in "a=1&b=2", percent-decoded; none when it is missing or broken.
std::optional<std::string> query_value(const std::string& query, const std::string& name);

}  // namespace flamefield
