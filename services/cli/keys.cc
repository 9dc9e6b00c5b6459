#include "services/bus/keys.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "proto/utc.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"

namespace flamefield {

namespace {

struct Options {
  DataOption data;
  std::filesystem::path keys, file, out;
  std::string role, name;
  bool json = false;
};

std::filesystem::path directory_of(const Options& options) {
  return options.keys.empty() ? options.data.dir / "keys" : options.keys;
}

void make(const Options& options) {
  const std::filesystem::path directory = directory_of(options);
  if (options.role.empty()) {
    (void)or_usage(KeyRing::open_or_create(directory));
    std::cout << directory.string() << ": keys of every role are there\n";
    return;
  }
  if (options.out.empty())
    throw CommandFailure{ExitCode::Usage,
                         "no --out (keys of one role are for another machine) name a directory for them"};
  or_usage(make_keys_for(directory, options.role, options.out));
  std::cout << "copy " << options.out.string()
            << " to the other machine, then here:\n  flamefield keys allow " << options.role << " "
            << (options.out / (options.role + ".pub")).string() << " --name NODE\n";
}

std::string time_text(const KeyEntry& entry) {
  return utc_text(entry.expires_s * 1'000'000'000);
}

void list(const Options& options) {
  const auto entries = or_usage(list_keys(directory_of(options)));
  auto all = nlohmann::ordered_json::array();
  for (const KeyEntry& entry : entries)
    all.push_back({{"role", entry.role},
                   {"name", entry.name},
                   {"public_key", entry.public_key},
                   {"has_secret", entry.has_secret},
                   {"expires", entry.expires_s == 0 ? nlohmann::ordered_json(nullptr)
                                                    : nlohmann::ordered_json(time_text(entry))},
                   {"file", entry.file.string()}});
  if (options.json) {
    std::cout << all.dump(2) << '\n';
    return;
  }
  std::cout << fmt::format("{:<11} {:<20} {:<41} {:<9} {}\n", "ROLE", "NAME", "PUBLIC KEY", "SECRET",
                           "EXPIRES");
  for (const KeyEntry& entry : entries)
    std::cout << fmt::format("{:<11} {:<20} {:<41} {:<9} {}\n", entry.role,
                             entry.name.empty() ? "(this machine)" : entry.name, entry.public_key,
                             entry.has_secret ? "here" : "elsewhere",
                             entry.expires_s == 0 ? "never" : time_text(entry));
}

void allow(const Options& options) {
  or_usage(allow_key(directory_of(options), options.role, options.name, options.file));
  std::cout << options.role << "-" << options.name << " may connect from now on\n";
}

void revoke(const Options& options) {
  or_usage(revoke_key(directory_of(options), options.role, options.name));
  std::cout << options.role << "-" << options.name << " is turned away from now on\n";
}

CLI::App* sub(CLI::App& parent, Session& session, const char* name, const char* help, const char* example,
              const std::shared_ptr<Options>& options, void (*work)(const Options&)) {
  auto* command = parent.add_subcommand(name, help);
  add_data(*command, options->data);
  command->add_option("--keys", options->keys, "Key directory (default: DATA/keys)");
  command->footer(concat("Example:\n  flamefield keys ", example));
  command->callback([=, &session] { session.choose([=] { work(*options); }); });
  return command;
}

}  // namespace

void add_keys(CLI::App& app, Session& session) {
  auto* keys = app.add_subcommand("keys", "Who may talk to the services: capture, worker, operator, viewer");
  keys->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* making = sub(*keys, session, "make", "Keys of this machine; or of one role, for another machine",
                     "make worker --out node7-keys", options, &make);
  making->add_option("ROLE", options->role, "capture, worker, operator or viewer");
  making->add_option("--out", options->out, "Directory for the other machine's keys");

  options = std::make_shared<Options>();
  sub(*keys, session, "list", "Who may connect", "list", options, &list)
      ->add_flag("--json", options->json, "Print as JSON");

  options = std::make_shared<Options>();
  auto* allowing = sub(*keys, session, "allow", "Let a public key in",
                       "allow worker node7-keys/worker.pub --name node7", options, &allow);
  allowing->add_option("ROLE", options->role, "capture, worker, operator or viewer")->required();
  allowing->add_option("FILE", options->file, "Its .pub file")->required();
  allowing->add_option("--name", options->name, "Of the machine or person")->required();

  options = std::make_shared<Options>();
  auto* revoking =
      sub(*keys, session, "revoke", "Turn a key away, at once", "revoke worker node7", options, &revoke);
  revoking->add_option("ROLE", options->role, "As 'keys list' prints it")->required();
  revoking->add_option("NAME", options->name, "As 'keys list' prints it")->required();
}

}  // namespace flamefield
