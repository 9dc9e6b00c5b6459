#include "services/bus/keys.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zmq.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <sstream>
#include <vector>

#include "proto/check.h"
#include "proto/job.h"
#include "proto/utc.h"
#include "services/bus/roles.h"

namespace flamefield {

namespace {

namespace fs = std::filesystem;
constexpr std::size_t kKeyLength = 40;

bool is_key(const std::string& text) {
  std::array<std::uint8_t, 32> bytes{};
  return text.size() == kKeyLength && zmq_z85_decode(bytes.data(), text.c_str()) != nullptr;
}

Result<> write_file(const fs::path& path, const std::string& text, mode_t mode) {
  // Created with its final mode, so that the secret is never readable by others, not even for a moment.
  const fs::path temporary = path.string() + ".new";
  ::unlink(temporary.c_str());
  const int fd = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  bool ok = fd >= 0 && ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
            ::fsync(fd) == 0;
  if (fd >= 0) ok = ::close(fd) == 0 && ok;
  ok = ok && ::rename(temporary.c_str(), path.c_str()) == 0;
  if (ok) return {};
  return unavailable(concat("cannot write key file ", path.string()), std::strerror(errno),
                     "check permissions and free space");
}

Result<std::vector<std::string>> read_lines(const fs::path& path) {
  std::ifstream in(path);
  if (!in)
    return not_found(concat("key file ", path.string()), std::strerror(errno),
                     "copy it from the dispatcher's machine");
  std::vector<std::string> lines;
  for (std::string line; lines.size() < 4 && std::getline(in, line);) lines.push_back(line);
  return lines;
}

tl::unexpected<Error> damaged(const fs::path& path) {
  return invalid_input(concat("key file ", path.string()), "it does not hold Z85 keys of 40 characters",
                       "restore it, or delete it to have new keys made");
}

Result<std::string> read_public(const fs::path& path) {
  const auto lines = read_lines(path);
  if (!lines) return tl::unexpected(lines.error());
  if (lines->empty() || !is_key((*lines)[0])) return damaged(path);
  return (*lines)[0];
}

Result<KeyPair> read_pair(const fs::path& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0 && (info.st_mode & 077) != 0)
    return invalid_input(concat("secret key ", path.string()), "others than its owner can read it",
                         concat("chmod 600 ", path.string()));
  const auto lines = read_lines(path);
  if (!lines) return tl::unexpected(lines.error());
  if (lines->size() < 2 || !is_key((*lines)[0]) || !is_key((*lines)[1])) return damaged(path);
  return KeyPair{(*lines)[1], (*lines)[0]};
}

// Of the second line of a public key; 0: none.
Result<std::int64_t> read_expiry(const fs::path& path) {
  const auto lines = read_lines(path);
  if (!lines) return tl::unexpected(lines.error());
  if (lines->size() < 2) return 0;
  std::istringstream words((*lines)[1]);
  std::string word;
  std::int64_t time_s = 0;
  if (words >> word >> time_s && word == "expires" && time_s > 0) return time_s;
  return damaged(path);
}

// "worker-node7.pub" -> "worker", "node7"
std::pair<std::string, std::string> role_and_name(const fs::path& path) {
  const std::string stem = path.stem().string();
  const std::size_t dash = stem.find('-');
  return {role_named(stem.substr(0, dash)), dash == std::string::npos ? "" : stem.substr(dash + 1)};
}

bool is_peer_role(const std::string& role) {
  const auto roles = peer_roles();
  return std::find(roles.begin(), roles.end(), role) != roles.end();
}

Result<> check_role(const std::string& role) {
  if (is_peer_role(role)) return {};
  return invalid_input(concat("role '", role, "'"), "there is none of this name",
                       "use capture, worker, operator or viewer");
}

std::string pair_text(const KeyPair& pair) {
  return pair.secret_key + "\n" + pair.public_key + "\n";
}

// The file of a role's secret; older installations have it under its old name.
fs::path secret_of(const fs::path& directory, const std::string& role) {
  const fs::path path = directory / (role + ".key");
  if (fs::exists(path)) return path;
  for (const char* old : {"producer", "client"}) {
    if (role_named(old) == role && fs::exists(directory / concat(old, ".key")))
      return directory / concat(old, ".key");
  }
  return path;
}

}  // namespace

KeyPair generate_keys() {
  std::array<char, kKeyLength + 1> public_key{}, secret_key{};
  const int failed = zmq_curve_keypair(public_key.data(), secret_key.data());
  expect(failed == 0, "libzmq was built with CURVE");
  return {public_key.data(), secret_key.data()};
}

Result<KeyRing> KeyRing::open_or_create(const fs::path& directory) {
  std::error_code problem;
  if (!fs::exists(directory)) {
    fs::create_directories(directory, problem);
    fs::permissions(directory, fs::perms::owner_all, problem);
  }
  KeyRing ring;
  std::vector<std::string> roles = {"dispatcher"};
  roles.insert(roles.end(), peer_roles().begin(), peer_roles().end());
  for (const std::string& role : roles) {
    const fs::path secret = secret_of(directory, role), open = directory / concat(role, ".pub");
    if (!fs::exists(secret, problem)) {
      if (auto ok = write_file(secret, pair_text(generate_keys()), 0600); !ok)
        return tl::unexpected(ok.error());
    }
    const auto pair = read_pair(secret);
    if (!pair) return tl::unexpected(pair.error());
    const auto shared = read_public(open);
    if (!shared || *shared != pair->public_key) {
      if (auto ok = write_file(open, pair->public_key + "\n", 0644); !ok) return tl::unexpected(ok.error());
    }
    ring.pairs_[role] = *pair;
  }
  ring.dispatcher_public_key_ = ring.of("dispatcher").public_key;
  auto allowed = read_allow_list(directory);
  if (!allowed) return tl::unexpected(allowed.error());
  ring.allowed_ = std::move(*allowed);
  ring.directory_ = directory;
  return ring;
}

Result<KeyRing> KeyRing::open(const fs::path& directory, const std::string& role_name) {
  const std::string role = role_named(role_name);
  const auto pair = read_pair(secret_of(directory, role));
  if (!pair) return tl::unexpected(pair.error());
  const auto dispatcher = read_public(directory / "dispatcher.pub");
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  KeyRing ring;
  ring.pairs_[role] = *pair;
  ring.dispatcher_public_key_ = *dispatcher;
  return ring;
}

const KeyPair& KeyRing::of(const std::string& role) const {
  const auto found = pairs_.find(role_named(role));
  expect(found != pairs_.end(), "the key ring was opened for this role");
  return found->second;
}

Result<std::vector<KeyEntry>> list_keys(const fs::path& directory) {
  std::error_code problem;
  std::vector<KeyEntry> entries;
  for (const auto& entry : fs::directory_iterator(directory, problem)) {
    if (entry.path().extension() != ".pub") continue;
    const auto key = read_public(entry.path());
    if (!key) return tl::unexpected(key.error());
    const auto expires_s = read_expiry(entry.path());
    if (!expires_s) return tl::unexpected(expires_s.error());
    auto [role, name] = role_and_name(entry.path());
    const bool has_secret = name.empty() && fs::exists(secret_of(directory, role));
    entries.push_back({std::move(role), std::move(name), *key, entry.path(), has_secret, *expires_s});
  }
  if (problem)
    return not_found(concat("key directory ", directory.string()), problem.message(), "start a service once");
  std::sort(entries.begin(), entries.end(),
            [](const KeyEntry& a, const KeyEntry& b) { return a.file < b.file; });
  return entries;
}

Result<AllowList> read_allow_list(const fs::path& directory) {
  const auto entries = list_keys(directory);
  if (!entries) return tl::unexpected(entries.error());
  const std::int64_t now_s = utc_now_ns() / 1'000'000'000;
  AllowList list;
  for (const KeyEntry& entry : *entries) {
    if (is_peer_role(entry.role) && !entry.is_expired(now_s)) list[entry.public_key] = entry.role;
  }
  return list;
}

Result<> make_keys_for(const fs::path& directory, const std::string& role, const fs::path& out) {
  if (auto ok = check_role(role); !ok) return ok;
  const auto dispatcher = read_public(directory / "dispatcher.pub");
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  std::error_code problem;
  if (fs::exists(out / (role + ".key"), problem))
    return invalid_input(concat("key ", (out / (role + ".key")).string()), "it is there already",
                         "choose another directory, or delete it first");
  if (fs::create_directories(out, problem)) fs::permissions(out, fs::perms::owner_all, problem);
  const KeyPair pair = generate_keys();
  if (auto ok = write_file(out / (role + ".key"), pair_text(pair), 0600); !ok) return ok;
  if (auto ok = write_file(out / (role + ".pub"), pair.public_key + "\n", 0644); !ok) return ok;
  return write_file(out / "dispatcher.pub", *dispatcher + "\n", 0644);
}

Result<> allow_key(const fs::path& directory, const std::string& role, const std::string& name,
                   const fs::path& public_key, std::int64_t expires_s) {
  if (auto ok = check_role(role); !ok) return ok;
  if (!is_file_safe(name))
    return invalid_input(concat("name '", name, "'"), "it becomes part of a file's name",
                         "use letters, digits, '.', '_' and '-'");
  const fs::path file = directory / concat(role, "-", name, ".pub");
  if (fs::exists(file))
    return invalid_input(concat("key ", file.string()), "the name is taken",
                         "revoke it first, or choose another");
  const auto key = read_public(public_key);
  if (!key) return tl::unexpected(key.error());
  const std::string expiry = expires_s == 0 ? "" : concat("expires ", expires_s, "\n");
  return write_file(file, *key + "\n" + expiry, 0644);
}

Result<> revoke_key(const fs::path& directory, const std::string& role, const std::string& name) {
  std::error_code problem;
  if (!is_file_safe(name) || !fs::remove(directory / concat(role, "-", name, ".pub"), problem))
    return not_found(concat("key ", role, "-", name), "it is not on the allow-list",
                     "see 'flamefield keys list'");
  return {};
}

}  // namespace flamefield
