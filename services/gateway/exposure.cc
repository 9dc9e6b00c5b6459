#include "services/gateway/exposure.h"

#include <arpa/inet.h>

namespace flamefield {

Result<> check_exposure(const std::string& address) {
  in_addr v4{};
  if (::inet_pton(AF_INET, address.c_str(), &v4) == 1 && (ntohl(v4.s_addr) >> 24) == 127) return {};
  in6_addr v6{};
  if (::inet_pton(AF_INET6, address.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6)) return {};
  return invalid_input(concat("cannot serve the page on ", address),
                       "it has neither TLS nor passwords of its own, so only this machine may reach it",
                       "use 127.0.0.1 with a reverse proxy in front, as in deploy/proxy");
}

}  // namespace flamefield
