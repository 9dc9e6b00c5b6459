#include "services/calibration/service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "services/api/pages.h"
#include "services/ledger/reader.h"
#include "services/serve/embedded.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using namespace std::chrono_literals;

TEST(CalibrationService, ClosesTheSessionOfAProgramThatWasKilled) {
  const Scratch scratch;
  Bus bus;
  EmbeddedOptions options;
  options.data_dir = scratch.path();
  options.http_port = -1;
  options.workers = 1;
  {
    const auto before = Embedded::start(bus, options).value();
    auto client = Client::connect(bus, "operator", unique_name("test"), "inproc://dispatcher").value();
    PutCapture open;
    open.kind = CaptureKind::Board;
    open.started_time_ns = 1;
    for (const char* id : {"20260301T101500000-calibration", "20260301T101500000-board"}) {
      open.id = id;
      ASSERT_TRUE(client.ask_for<Accepted>(open, 60s));
    }
  }
  const auto after = Embedded::start(bus, options).value();
  CalibrationServiceOptions session;
  session.data_dir = scratch.path();
  session.endpoints = {"inproc://calibration-2"};
  const auto service = CalibrationService::open(bus, session).value();
  std::jthread thread([&](std::stop_token stop) { (void)service->run(stop); });
  EXPECT_TRUE(testing_support::eventually([&] {
    const auto captures = LedgerReader::open(scratch.path()).value().captures().value();
    return captures.at(1).capture.end == CaptureEnd::Interrupted ||
           captures.at(0).capture.end == CaptureEnd::Interrupted;
  }));
  const auto rows = LedgerReader::open(scratch.path()).value().captures().value();
  for (const CaptureRow& row : rows)
    EXPECT_EQ(row.capture.finished_time_ns != 0, row.capture.id.ends_with("-calibration")) << row.capture.id;
}

TEST(CalibrationApi, SaysThatNobodyHoldsSessionsWithoutFailing) {
  const Scratch scratch;
  Bus bus;
  for (const std::string& endpoint : {std::string(), "ipc://" + (scratch.path() / "none.sock").string()}) {
    LiveServices services(bus, {.role = "operator",
                                .acquisition = "inproc://acquisition",
                                .dispatcher = "inproc://dispatcher",
                                .data_dir = scratch.path(),
                                .calibration = endpoint});
    HttpRequest get;
    get.method = "GET";
    const auto state = answer_api(services, "calibration", get).value();
    EXPECT_EQ(state.status, 200);
    EXPECT_EQ(json::parse(state.body)["state"], "unavailable");
    EXPECT_THAT(json::parse(state.body)["why"].get<std::string>(), HasSubstr("flamefield serve"));
    const auto history = answer_api(services, "calibrations", get).value();
    EXPECT_EQ(history.status, 200);
    EXPECT_TRUE(json::parse(history.body)["calibrations"].empty());
    HttpRequest post;
    post.method = "POST";
    post.body = "{}";
    EXPECT_EQ(answer_api(services, "calibration/start", post).value().status, 503);
  }
}

}  // namespace
}  // namespace flamefield
