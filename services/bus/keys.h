#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "proto/error.h"

namespace flamefield {

// A CURVE key pair, each key as 40 characters of Z85.
struct KeyPair {
  std::string public_key;
  std::string secret_key;
};
KeyPair generate_keys();

// Who may connect: public key -> role, one of peer_roles().
using AllowList = std::map<std::string, std::string>;
// What the .pub files of a directory say that are not out of date. InvalidInput: a damaged file.
Result<AllowList> read_allow_list(const std::filesystem::path& directory);

// One key of a directory.
struct KeyEntry {
  std::string role;
  std::string name;  // of the further machine; empty: this one's own
  std::string public_key;
  std::filesystem::path file;
  bool has_secret = false;     // its .key is here
  std::int64_t expires_s = 0;  // UTC; 0: never
  bool is_expired(std::int64_t now_s) const { return expires_s != 0 && now_s >= expires_s; }
};
Result<std::vector<KeyEntry>> list_keys(const std::filesystem::path& directory);

// A pair for another machine, in a directory of its own, with the dispatcher's public key: all that it needs.
// InvalidInput: no such role, or there is a key already.
Result<> make_keys_for(const std::filesystem::path& directory, const std::string& role,
                       const std::filesystem::path& out);
// Lets a public key in, under a name, until a time (UTC; 0: for good). InvalidInput: no such role, no key, or
// the name is taken.
Result<> allow_key(const std::filesystem::path& directory, const std::string& role, const std::string& name,
                   const std::filesystem::path& public_key, std::int64_t expires_s = 0);
// Takes ROLE-NAME.pub away; its holder's messages count no more. NotFound.
Result<> revoke_key(const std::filesystem::path& directory, const std::string& role, const std::string& name);

// One directory holds the keys of an installation:
//   ROLE.key  secret and public key of a role, readable by its owner only
//   ROLE.pub  its public key; further machines are let in by adding ROLE-NAME.pub, whose second line may be
//             "expires SECONDS" (UTC): a key that is lost with a job of a cluster does not count for ever
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
  const std::filesystem::path& directory() const { return directory_; }  // of the allow-list; empty: none

 private:
  std::filesystem::path directory_;
  std::map<std::string, KeyPair> pairs_;
  std::string dispatcher_public_key_;
  AllowList allowed_;
};

}  // namespace flamefield
