#pragma once

#include <span>
#include <string>
#include <string_view>

#include "proto/message.h"

namespace flamefield {

// Whom a key may stand for, besides the dispatcher itself:
//   capture   stores captures and their sets
//   worker    takes jobs, reads sets, hands results in
//   operator  arms, submits, decides: everything but the two above
//   viewer    looks: status, previews, stored sets
std::span<const std::string_view> peer_roles();

// May a peer of this role send this message to a service? "local", a thread of our own process, may send
// anything.
bool may_send(std::string_view role, const Message& message);

// What a peer is told that may not.
Error forbidden(std::string_view whom, std::string_view role);

// The role behind a name: roles were called "producer" and "client" once, and keys still may be.
std::string role_named(std::string_view name);

}  // namespace flamefield
