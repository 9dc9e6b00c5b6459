// `flamefield serve`, and the same services as separate daemons, used from the command line.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "tests/e2e/installation.h"
#include "tests/services/chaos.h"

namespace flamefield {
namespace {

using testing_support::Process;

// A port of this machine that somebody else holds.
class TakenPort {
 public:
  TakenPort() : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(socket_, 1), 0);
    socklen_t size = sizeof address;
    EXPECT_EQ(::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
  }
  ~TakenPort() { ::close(socket_); }
  std::string number() const { return std::to_string(port_); }

 private:
  int socket_;
  int port_ = 0;
};

class Services : public testing::Test {
 protected:
  void SetUp() override {
    overwrite(scratch_ / "lab.toml",
              "data_directory = \"data\"\n[simulator]\ncameras = 3\nflame = \"torus\"\n"
              "[reconstruction]\nsize = [12, 12, 12]\nspacing_mm = 5\norigin_mm = [-27.5, 12.5, -27.5]\n");
  }
  Process serve(const std::string& more_key = {}, const std::string& more_value = {}) {
    std::vector<std::string> arguments = {
        "serve", "--config",        (scratch_ / "lab.toml").string(), "--port",
        "0",     "--first-address", unused_loopback_address()};
    if (!more_key.empty()) arguments.insert(arguments.end(), {more_key, more_value});
    return Process("flamefield", arguments, scratch_ / "serve.log");
  }
  ProgramResult flamefield_here(const std::string& arguments) {
    return run_flamefield(scratch_.path(), arguments + " --data data");
  }
  bool answers() {
    return eventually([&] { return flamefield_here("status").exit_code == 0; });
  }
  nlohmann::json json(const std::string& arguments) {
    const ProgramResult result = flamefield_here(arguments + " --json");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out, nullptr, false);
  }
  std::string log(const std::string& name) { return read_text_file(scratch_ / name).value_or(""); }

  Scratch scratch_;
};

TEST_F(Services, ServeGuidesACalibrationAndKeepsItsHistory) {
  Process server = serve();
  ASSERT_TRUE(answers()) << log("serve.log");
  EXPECT_TRUE(json("calibrate history").empty());
  const ProgramResult result = flamefield_here(
      "calibrate session --automatic --poses 8 --accept --by tester --note 'first light' --out new.yaml "
      "--json");
  ASSERT_EQ(result.exit_code, 0) << result.err << log("serve.log");
  const auto state = nlohmann::json::parse(result.out);
  EXPECT_EQ(state["state"], "idle");
  EXPECT_EQ(state["accepted_version"], 1);
  EXPECT_GE(state["poses"], 8);
  EXPECT_TRUE(state["links_missing"].empty());
  EXPECT_NE(result.err.find("put the board into its holder"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("-> take "), std::string::npos) << result.err;
  EXPECT_TRUE(std::filesystem::exists(scratch_ / "data" / state["report"].get<std::string>()));
  const auto history = json("calibrate history");
  ASSERT_EQ(history.size(), 1u);
  EXPECT_EQ(history[0]["note"], "first light");
  EXPECT_TRUE(history[0]["predecessor"].is_null());
  ASSERT_EQ(flamefield_here("calibrate history --version 1 --out old.yaml").exit_code, 0);
  EXPECT_EQ(log("new.yaml"), log("old.yaml"));
  EXPECT_EQ(flamefield_here("calibrate history --version 2 --out none.yaml").exit_code, 1);
  // The pictures that it was made of are a capture like any other.
  EXPECT_EQ(json("runs list --captures").size(), 1u);
}

TEST_F(Services, ServeCapturesAndKeepsItsBooks) {
  Process server = serve();
  ASSERT_TRUE(answers()) << log("serve.log");
  const auto captured = json("capture burst --pulses 6");
  EXPECT_EQ(captured["sets_stored"], 6);
  EXPECT_EQ(captured["frames_lost"], 0);
  const auto receipt = json("runs receipt " + captured["capture"].get<std::string>());
  EXPECT_TRUE(receipt["balances"].get<bool>());
  EXPECT_EQ(receipt["sets"], 6);
  EXPECT_EQ(receipt["cameras"].size(), 3u);
  EXPECT_EQ(json("runs list --captures").size(), 1u);
  EXPECT_EQ(json("runs list").size(), 0u);  // no rig, no volumes
  server.signal(SIGINT);
  EXPECT_EQ(server.wait(), 0) << log("serve.log");
}

TEST_F(Services, StopDrainsALiveCapture) {
  Process server = serve();
  ASSERT_TRUE(answers()) << log("serve.log");
  Process live("flamefield", {"capture", "live", "--data", (scratch_ / "data").string()},
               scratch_ / "live.log");
  ASSERT_TRUE(eventually([&] { return json("status")["array"]["sets_stored"].get<int>() >= 3; }));
  const auto stopped = json("stop");
  EXPECT_GE(stopped["sets"].get<int>(), 3);
  EXPECT_EQ(stopped["sets"], stopped["sets_stored"]);
  EXPECT_EQ(live.wait(), 0) << log("live.log");
}

TEST_F(Services, ASecondServerOnTheSameDataIsRefused) {
  Process server = serve();
  ASSERT_TRUE(answers()) << log("serve.log");
  const ProgramResult second =
      run_flamefield(scratch_.path(), "serve --config lab.toml --port 0 --first-address 127.199.1.2");
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_NE(second.err.find("ledger"), std::string::npos) << second.err;
  EXPECT_EQ(flamefield_here("status").exit_code, 0) << "the first one goes on";
}

TEST_F(Services, APortInUseIsNamed) {
  const TakenPort taken;
  const ProgramResult result =
      run_flamefield(scratch_.path(), "serve --config lab.toml --port " + taken.number() +
                                          " --first-address " + unused_loopback_address());
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find(taken.number()), std::string::npos) << result.err;
}

TEST_F(Services, ACommandWithoutAServerSaysHowToStartOne) {
  const ProgramResult result = flamefield_here("capture burst");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("flamefield serve"), std::string::npos) << result.err;
}

TEST_F(Services, SeparateDaemonsDoTheSame) {
  Process array("flamefield",
                {"simulate", "--cameras", "2", "--flame", "torus", "--rate-hz", "10", "--first-address",
                 unused_loopback_address()},
                scratch_ / "array.log");
  const std::string address = unused_loopback_address();
  const std::string second = address.substr(0, address.size() - 1) + "3";
  overwrite(scratch_ / "real.toml", "data_directory = \"data\"\n[[camera]]\nname = \"cam00\"\naddress = \"" +
                                        address + "\"\n[[camera]]\nname = \"cam01\"\naddress = \"" + second +
                                        "\"\n");
  const std::string data = (scratch_ / "data").string();
  Process dispatcher("flamefield-dispatchd", {"--data", data}, scratch_ / "dispatchd.log");
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(scratch_ / "data/run/dispatcher.sock"); }));
  Process worker("flamefield-worker", {"--data", data}, scratch_ / "worker.log");
  Process gateway("flamefield-gatewayd", {"--data", data, "--port", "0"}, scratch_ / "gatewayd.log");
  // The array renders its flame first; the daemon is refused until the cameras answer.
  std::optional<Process> acquisition;
  ASSERT_TRUE(eventually([&] {
    acquisition.emplace("flamefield-acquired",
                        std::vector<std::string>{"--config", (scratch_ / "real.toml").string()},
                        scratch_ / "acquired.log");
    const bool is_up = eventually([&] {
                         return log("acquired.log").find("acquisition-started") != std::string::npos ||
                                log("acquired.log").find("flamefield-acquired: ") != std::string::npos;
                       }) &&
                       log("acquired.log").find("acquisition-started") != std::string::npos;
    if (!is_up) overwrite(scratch_ / "acquired.log", "");
    return is_up;
  })) << log("acquired.log");
  const auto captured = json("capture burst --pulses 5");
  EXPECT_EQ(captured["sets_stored"], 5);
  EXPECT_EQ(captured["frames_lost"], 0);
  const auto status = json("status");
  EXPECT_EQ(status["dispatcher"]["workers"].size(), 1u);
  EXPECT_EQ(status["array"]["cameras"].size(), 2u);
  for (Process* process : {&*acquisition, &gateway, &worker, &dispatcher, &array}) {
    process->signal(SIGTERM);
    EXPECT_EQ(process->wait(), 0);
  }
}

}  // namespace
}  // namespace flamefield
