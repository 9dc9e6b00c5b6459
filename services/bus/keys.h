#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "proto/error.h"

namespace flamefield {

// A CURVE key pair, each key as 40 characters of Z85.
struct KeyPair {
  std::string public_key;
  std::string secret_key;
};
KeyPair generate_keys();

// Who may connect: public key -> role ("producer", "worker", "client").
using AllowList = std::map<std::string, std::string>;

// One directory holds the keys of an installation:
//   ROLE.key  secret and public key of a role, readable by its owner only
//   ROLE.pub  its public key; further machines are let in by adding ROLE-NAME.pub
class KeyRing {
 public:
  // Makes what is missing: the dispatcher's keys and those of each role. Unavailable: cannot be written.
  // InvalidInput: a damaged file, or a secret that others can read.
  static Result<KeyRing> open_or_create(const std::filesystem::path& directory);

  // For a machine that was given only its own role's .key and the dispatcher's .pub. NotFound otherwise.
  static Result<KeyRing> open(const std::filesystem::path& directory, const std::string& role);

  const KeyPair& of(const std::string& role) const;  // contract: a role that was opened
  const std::string& dispatcher_public_key() const { return dispatcher_public_key_; }
  const AllowList& allowed() const { return allowed_; }

 private:
  std::map<std::string, KeyPair> pairs_;
  std::string dispatcher_public_key_;
  AllowList allowed_;
};

}  // namespace flamefield
