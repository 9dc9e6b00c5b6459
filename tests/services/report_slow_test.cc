#include "services/report/report.h"

#include <gtest/gtest.h>

#include <cctype>
#include <filesystem>
#include <fstream>
#include <set>
#include <vector>

#include "services/report/gnuplot.h"
#include "services/report/html.h"
#include "services/report/report_sections.h"
#include "tests/services/report_data.h"

namespace flamefield {
namespace {

bool contains(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

// The first tag that does not close what was opened, or an attribute quote that does not end; empty when the
// page is well formed. Void elements must be closed as in XML, which HTML allows.
std::string ill_formed(const std::string& html) {
  std::vector<std::string> open;
  for (std::size_t at = html.find('<'); at != std::string::npos; at = html.find('<', at + 1)) {
    std::size_t end = at + 1;
    for (char quote = 0; end < html.size() && (quote || html[end] != '>'); ++end) {
      if (quote) {
        if (html[end] == quote) quote = 0;
      } else if (html[end] == '"' || html[end] == '\'') {
        quote = html[end];
      } else if (html[end] == '<') {
        return html.substr(at, 80);
      }
    }
    if (end >= html.size()) return html.substr(at, 80);
    std::size_t name_end = at + 1 + (html[at + 1] == '/');
    while (std::isalnum(static_cast<unsigned char>(html[name_end])) || html[name_end] == '-') ++name_end;
    const std::string tag = html.substr(at, end - at + 1);
    const bool void_tag = tag.starts_with("<!") || tag.starts_with("<meta") || tag.ends_with("/>");
    if (html[at + 1] == '/') {
      if (open.empty() || open.back() != html.substr(at + 2, name_end - at - 2)) return tag;
      open.pop_back();
    } else if (!void_tag) {
      open.push_back(html.substr(at + 1, name_end - at - 1));
    }
    at = end;
  }
  return open.empty() ? "" : "unclosed " + open.back();
}

// What a reader sees: the page without tags and style.
std::string text_of_page(const std::string& html) {
  std::string out;
  bool tag = false;
  for (char c : html.substr(html.find("</head>"))) {
    if (c == '<') {
      tag = true;
      out += ' ';
    }
    if (!tag) out += c;
    if (c == '>') tag = false;
  }
  return out;
}

const std::string& full_page() {
  static const std::string page = [] {
    const auto html = report_html(report_data(6, 8, 24, 26));
    EXPECT_TRUE(html) << html.error().message;
    return html.value_or("");
  }();
  return page;
}

TEST(Report, IsWellFormed) {
  EXPECT_EQ(ill_formed(full_page()), "");
}

TEST(Report, HasEverySection) {
  for (const char* heading : {"At a glance", "What the cameras saw", "The flame, pulse by pulse",
                              "Truth and reconstruction, slice by slice", "How well they agree",
                              "Does the volume explain the images?", "How well the cameras are known",
                              "Every pulse", "Latency", "Receipt", "How to repeat this"}) {
    EXPECT_TRUE(contains(full_page(), concat("<h2>", heading, "</h2>"))) << heading;
  }
}

TEST(Report, NamesTheUnitOnEveryAxis) {
  for (const char* label : {"HAB y (mm)",
                            "x (mm)",
                            "z (mm)",
                            "emission (a.u.)",
                            "difference (a.u.)",
                            "Pearson correlation (1)",
                            "SqMD (1)",
                            "true emission (a.u.)",
                            "RMS residual (px)",
                            "residual in x or y (px)",
                            "corner coordinates (count)",
                            "board pose (number)",
                            "iteration (count)",
                            "residual |Ax − b| / |b| (1)",
                            "time (ms)",
                            "share of pulses (%)",
                            "pulse (number)",
                            "σ position (mm)",
                            "σ rotation (mrad)",
                            "Frames stored (count)"}) {
    EXPECT_TRUE(contains(text_of_page(full_page()), label)) << label;
  }
}

TEST(Report, NeverPrintsNaNOrInfinity) {
  const std::string text = text_of_page(full_page());
  std::string word;
  for (char c : text + " ") {
    if (std::isalpha(static_cast<unsigned char>(c))) {
      word += static_cast<char>(std::tolower(c));
      continue;
    }
    EXPECT_FALSE(word == "nan" || word == "inf") << text.substr(0, 200);
    word.clear();
  }
}

TEST(Report, NeedsNoNetworkAndNoScript) {
  std::string page = full_page();
  for (std::size_t at; (at = page.find("http://www.w3.org/")) != std::string::npos;) page.erase(at, 18);
  EXPECT_FALSE(contains(page, "http://"));
  EXPECT_FALSE(contains(page, "https://"));
  EXPECT_FALSE(contains(page, "url(http"));
  EXPECT_FALSE(contains(page, "<script"));
  EXPECT_FALSE(contains(page, "<link"));
}

TEST(Report, IdentifiersAreUniqueInThePage) {
  std::set<std::string> seen;
  for (const std::string& mark : {std::string(" id=\""), std::string(" id='")}) {
    for (std::size_t at = full_page().find(mark); at != std::string::npos;
         at = full_page().find(mark, at + 1)) {
      const std::size_t start = at + mark.size();
      const std::string id = full_page().substr(start, full_page().find(mark.back(), start) - start);
      EXPECT_TRUE(seen.insert(id).second) << id;
    }
  }
  EXPECT_GT(seen.size(), 10u);
}

TEST(Report, EscapesWhatUsersType) {
  EXPECT_TRUE(contains(full_page(), "Stratified flame &lt;15 cameras&gt; &amp; a burst"));
  EXPECT_TRUE(contains(full_page(), "&#39;run &gt; 3&#39;"));
}

TEST(Report, FollowsTheThemeOfTheReader) {
  EXPECT_TRUE(contains(full_page(), "prefers-color-scheme: dark"));
  EXPECT_TRUE(contains(full_page(), "currentColor"));
  EXPECT_FALSE(contains(full_page(), "rgb(  1,   2,   3)"));
  EXPECT_FALSE(contains(full_page(), "rgb(1,2,3)"));
  EXPECT_FALSE(contains(full_page(), " color=\"black\""));
}

TEST(Report, VerdictsAreWordsAndNotColoursOnly) {
  ReportData data;
  data.pulses = 30, data.sets = 29, data.volumes = 29;
  EXPECT_TRUE(contains(headline_section(data), "✗ poor"));
  EXPECT_TRUE(contains(headline_section(data), "30 → 29 → 29"));
  data.sets = data.volumes = 30;
  EXPECT_TRUE(contains(headline_section(data), "✓ good"));
}

TEST(Report, AReceiptThatDoesNotAddUpSaysByHowMuch) {
  ReportData data;
  data.receipts = {{"cam00", 30, 27, {{"missed", 1}}}, {"cam01", 30, 30, {}}};
  EXPECT_TRUE(contains(receipt_section(data), "2 unaccounted"));
  EXPECT_TRUE(contains(receipt_section(data), "adds up"));
}

TEST(Report, WithoutATruthTheComparisonsAreLeftOut) {
  ReportData data = report_data(3, 3, 16, 16);
  data.field->truth.reset();
  data.field->metrics.reset();
  data.calibration.reset();
  data.film.clear();
  for (ReportPulse& p : data.per_pulse) p.pearson = p.sqmd = kUnknown;
  const auto html = report_html(data);
  ASSERT_TRUE(html) << html.error().message;
  EXPECT_EQ(ill_formed(*html), "");
  EXPECT_FALSE(contains(*html, "How well they agree"));
  EXPECT_FALSE(contains(*html, "Pearson"));
  EXPECT_FALSE(contains(*html, "How well the cameras are known"));
  EXPECT_TRUE(contains(*html, "The reconstruction in slices"));
}

TEST(Report, OfNothingIsStillAPage) {
  const auto html = report_html({});
  ASSERT_TRUE(html) << html.error().message;
  EXPECT_EQ(ill_formed(*html), "");
  EXPECT_FALSE(contains(*html, "<section>"));
}

TEST(Report, RefusesATruthOnAnotherGrid) {
  ReportData data = report_data(3, 3, 16, 16);
  data.field->truth = Volume(centred_grid(8, 8, 8, 1));
  const auto html = report_html(data);
  ASSERT_FALSE(html);
  EXPECT_EQ(html.error().code, ErrorCode::InvalidInput);
}

TEST(Report, OfFifteenCamerasAndThirtyPulsesStaysUnderFifteenMegabytes) {
  const ScratchFolder folder;
  const auto path = folder.path() / "report.html";
  const auto written = write_report(path, report_data(15, 30, 32, 32));
  ASSERT_TRUE(written) << written.error().message;
  EXPECT_LT(std::filesystem::file_size(path), 15u << 20);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(Report, ToAFolderThatIsNotThereFails) {
  const auto written = write_report("/nonexistent/report.html", {});
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::InvalidInput);
}

TEST(Html, Base64AgreesWithTheExamplesOfRfc4648) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

TEST(Html, NumbersKeepTheirSignificantDigits) {
  EXPECT_EQ(number(0), "0");
  EXPECT_EQ(number(0.08361), "0.0836");
  EXPECT_EQ(number(0.9684), "0.968");
  EXPECT_EQ(number(96.44), "96.4");
  EXPECT_EQ(number(2881.4), "2881");
  EXPECT_EQ(number(1.2e-7), "1.2e-07");
  EXPECT_EQ(number(kUnknown), "–");
}

TEST(Statistics, TheNinetyNinthPercentileOfAHundredValuesIsTheNinetyNinth) {
  std::vector<double> values;
  for (int i = 100; i >= 1; --i) values.push_back(i);
  values.push_back(kUnknown);
  const Statistics s = statistics(values);
  EXPECT_EQ(s.count, 100u);
  EXPECT_DOUBLE_EQ(s.p99, 99);
  EXPECT_DOUBLE_EQ(s.median, 50);
  EXPECT_DOUBLE_EQ(s.mean, 50.5);
  EXPECT_NEAR(s.sd, 29.0115, 1e-4);
}

}  // namespace
}  // namespace flamefield
