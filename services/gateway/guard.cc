#include "services/gateway/guard.h"

#include <fcntl.h>
#include <sys/random.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>

namespace flamefield {
namespace {

constexpr std::size_t kTokenLetters = 48;

HttpResponse refusal(int status, const std::string& message) {
  return {.status = status,
          .content_type = "application/json",
          .body = "{\"error\":\"" + message + "\"}\n",
          .file = {},
          .headers = {}};
}

// "127.0.0.1:8080" -> "127.0.0.1", "[::1]:8080" -> "[::1]"
std::string host_name(const std::string& host) {
  const std::size_t colon = host.rfind(':');
  const bool has_port = colon != std::string::npos && host.find(']', colon) == std::string::npos;
  return has_port ? host.substr(0, colon) : host;
}

bool is_this_machine(const std::string& name) {
  return name == "localhost" || name == "[::1]" ||
         (name.starts_with("127.") && name.find_first_not_of("0123456789.") == std::string::npos);
}

// Takes the same time wherever the first difference is.
bool equal(const std::string& a, const std::string& b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) difference |= static_cast<unsigned>(a[i] ^ b[i]) & 0xffu;
  return difference == 0;
}

bool is_token(const std::string& text) {
  return text.size() == kTokenLetters && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

}  // namespace

std::string Guard::cookie_name(const HttpRequest& request) const {
  // Cookies know no ports: two gateways on one machine must not overwrite each other's.
  const std::string host = request.header("host");
  const std::size_t colon = host.rfind(':');
  return "flamefield-" + (colon == std::string::npos ? std::string("80") : host.substr(colon + 1));
}

std::optional<HttpResponse> Guard::refuse(const HttpRequest& request) const {
  const std::string host = request.header("host"), origin = request.header("origin");
  const std::string name = host_name(host);
  if (!name.empty() && !is_this_machine(name) && name != public_name_) {
    return refusal(403, "this page is served as localhost, 127.0.0.1 or web.public_name only");
  }
  if (!origin.empty() && origin != "http://" + host && origin != "https://" + host) {
    return refusal(403, "pages of other sites may not ask here");
  }
  return std::nullopt;
}

std::optional<HttpResponse> Guard::refuse_command(const HttpRequest& request) const {
  if (!request.header("content-type").starts_with("application/json")) {
    return refusal(415, "commands are JSON: send Content-Type application/json");
  }
  if (token_.empty()) return refusal(403, "this page takes no commands");
  const std::string bearer = request.header("authorization");
  if (bearer.starts_with("Bearer ") && equal(bearer.substr(7), token_)) return std::nullopt;
  const std::string site = request.header("sec-fetch-site");
  const bool is_same_site = site.empty() ? !request.header("origin").empty() : site == "same-origin";
  const std::string cookies = "; " + request.header("cookie") + ";";
  const bool has_cookie = cookies.find("; " + cookie_name(request) + "=" + token_ + ";") != std::string::npos;
  if (has_cookie && is_same_site) return std::nullopt;
  return refusal(403,
                 "commands need the token: open the page as /?token=TOKEN, or send Authorization: Bearer "
                 "TOKEN; it is in the file run/web-token of the data directory");
}

std::optional<std::string> Guard::cookie_for(const HttpRequest& page) const {
  if (token_.empty()) return std::nullopt;
  const auto given = query_value(page.query, "token");
  const bool is_near = is_this_machine(host_name(page.header("host")));
  if (!is_near && !(given && equal(*given, token_))) return std::nullopt;
  return concat(cookie_name(page), "=", token_, "; Path=/; HttpOnly; SameSite=Strict",
                is_near ? "" : "; Secure");
}

Result<std::string> token_in(const std::filesystem::path& file) {
  std::string token;
  if (std::ifstream(file) >> token && is_token(token)) return token;
  std::array<unsigned char, kTokenLetters / 2> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    return unavailable("no token for commands", "the system gave no random numbers", "try again");
  }
  token.clear();
  for (const unsigned char byte : bytes) {
    token += "0123456789abcdef"[byte >> 4];
    token += "0123456789abcdef"[byte & 15];
  }
  std::error_code ignored;
  std::filesystem::create_directories(file.parent_path(), ignored);
  std::filesystem::remove(file, ignored);
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  const std::string line = token + "\n";
  const bool written = fd >= 0 && ::write(fd, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  if (fd >= 0) ::close(fd);
  if (!written) {
    return unavailable("cannot write " + file.string(), "commands of the page need it",
                       "check the rights of the data directory");
  }
  return token;
}

std::optional<std::string> query_value(const std::string& query, const std::string& name) {
  for (std::size_t at = 0; at <= query.size();) {
    const std::size_t end = std::min(query.find('&', at), query.size());
    const std::string pair = query.substr(at, end - at);
    if (pair.starts_with(name + "=")) {
      std::string value = pair.substr(name.size() + 1);
      for (char& c : value) c = c == '+' ? ' ' : c;
      return value.empty() ? std::optional(value) : percent_decoded(value);
    }
    at = end + 1;
  }
  return std::nullopt;
}

}  // namespace flamefield
