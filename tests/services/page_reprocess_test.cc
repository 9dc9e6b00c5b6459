// Reprocessing asked for by the pages, with a dispatcher and a worker behind them.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "services/api/pages.h"
#include "tests/services/dispatcher_fixture.h"

namespace flamefield {
namespace {

using nlohmann::json;

class PageReprocess : public testing_support::DispatcherTest {
 protected:
  json post(const std::string& path, const json& body) {
    const HttpRequest request{"POST", "/api/v1/" + path, "", {}, body.dump()};
    const auto answer = answer_api(services_, path, request);
    EXPECT_TRUE(answer);
    return answer ? json::parse(answer->body) : json();
  }
  LiveServices services_{bus_, {"operator", "inproc://no-array", "inproc://dispatcher", scratch_.path()}};
};

TEST_F(PageReprocess, MakesWhatIsNewAndNamesWhatIsThere) {
  put_sets(3);
  const Submitted first = submit();
  const auto worker = start_worker(good_step());
  ASSERT_TRUE(all_done(3));
  const json other = {
      {"runs", first.run_ids}, {"solver", "mlem"}, {"settings", {{"mlem.max_iterations", 7}}}};
  json tried = other;
  tried["only_first"] = true;

  json estimate = post("reprocess/estimate", other);
  EXPECT_EQ(estimate["volumes"], 3);
  EXPECT_EQ(estimate["identical"], 0);
  EXPECT_TRUE(estimate["seconds_each"].is_null()) << "mlem was never run here";
  EXPECT_EQ(post("reprocess", tried)["jobs"].size(), 1u);
  ASSERT_TRUE(all_done(4));
  EXPECT_EQ(post("reprocess/estimate", other)["identical"], 1);
  const json made = post("reprocess", other);
  EXPECT_EQ(made["jobs"].size(), 2u);
  EXPECT_EQ(made["runs"].size(), 3u);
  ASSERT_TRUE(all_done(6));

  const json again = post("reprocess", other);
  EXPECT_TRUE(again["jobs"].empty());
  EXPECT_EQ(again["identical"], 3);
  EXPECT_EQ(again["runs"].size(), 3u);
  EXPECT_EQ(post("reprocess", tried)["runs"].size(), 1u) << "the page shows the one that is there";
  const auto page = ask<Jobs>(GetJobs{});
  EXPECT_EQ(page.rows.back().submitter, "page");
}

TEST_F(PageReprocess, NamesWhatIsWrongWithTheOrder) {
  put_sets(1);
  const Submitted first = submit();
  const auto worker = start_worker(good_step());
  ASSERT_TRUE(all_done(1));
  const auto problem = [&](const json& body) { return post("reprocess", body).value("error", ""); };
  EXPECT_NE(problem({{"runs", {"no-such-run"}}}).find("no-such-run"), std::string::npos);
  EXPECT_NE(problem({{"runs", first.run_ids}, {"solver", "magic"}}).find("magic"), std::string::npos);
}

}  // namespace
}  // namespace flamefield
