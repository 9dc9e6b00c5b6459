#include "services/report/report.h"

#include "services/report/html.h"
#include "services/report/picture.h"
#include "services/report/report_sections.h"
#include "services/store/file.h"

namespace flamefield {
namespace {

constexpr const char* kStyle = R"css(
:root { color-scheme: light dark; --ink: #1b1f24; --dim: #5b6570; --paper: #ffffff; --card: #f5f6f8; --line: #d6dae0;
  --good: #0a7d4f; --fair: #8a5a00; --poor: #b3261e; --good-bg: #dff5ea; --fair-bg: #fdf0d2; --poor-bg: #fbe1df; }
@media (prefers-color-scheme: dark) { :root { --ink: #d7dde4; --dim: #929ca8; --paper: #0f1216; --card: #171b21;
  --line: #2c333c; --good: #5fd3a0; --fair: #f0b955; --poor: #ff8a80; --good-bg: #12352a; --fair-bg: #3a2d10; --poor-bg: #43201d; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 32px 28px 64px; }
h1 { font-size: 30px; font-weight: 650; margin: 0; letter-spacing: -0.01em; }
h2 { font-size: 20px; font-weight: 650; margin: 0 0 2px; }
section { margin-top: 44px; padding-top: 22px; border-top: 1px solid var(--line); }
.lead, .subtitle { color: var(--dim); margin: 0 0 14px; }
.hero { margin: 22px 0 0; } .hero img { width: 100%; height: auto; border-radius: 10px; display: block; }
figure { margin: 0; } figcaption { color: var(--dim); font-size: 13px; margin-top: 4px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 7px 12px 7px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
thead th { color: var(--dim); font-weight: 500; font-size: 13px; }
.headline strong { font-size: 17px; white-space: nowrap; } .headline td:last-child { color: var(--dim); }
.numbers td:not(:first-child), .numbers th:not(:first-child) { text-align: right; }
.chip { border-radius: 999px; padding: 2px 10px; font-size: 13px; background: var(--card); color: var(--dim); white-space: nowrap; }
.chip.good { background: var(--good-bg); color: var(--good); } .chip.fair { background: var(--fair-bg); color: var(--fair); }
.chip.poor { background: var(--poor-bg); color: var(--poor); }
.pair { display: grid; grid-template-columns: 4fr 3fr; gap: 20px; align-items: start; margin-bottom: 12px; }
.pair img { width: 100%; height: auto; border-radius: 6px; display: block; } .pair .pixels { max-height: 480px; object-fit: contain; object-position: left; }
.pixels { image-rendering: pixelated; }
.sheet { display: grid; grid-template-columns: repeat(auto-fill, minmax(200px, 1fr)); gap: 14px; margin-top: 14px; }
.sheet figure { display: grid; grid-template-columns: 4fr 3fr; gap: 4px; } .sheet figcaption { grid-column: 1 / -1; margin: 0; }
.sheet img { width: 100%; height: 100%; object-fit: cover; border-radius: 3px; }
.film { display: grid; grid-template-columns: repeat(6, 1fr); gap: 8px; margin-bottom: 12px; }
.film img { width: 100%; height: auto; border-radius: 6px; display: block; } .film figcaption { text-align: center; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(440px, 1fr)); gap: 24px 32px; margin: 12px 0; }
.plots figure { break-inside: avoid; } .plots svg { width: 100%; height: auto; max-width: 640px; max-height: 470px; display: block; }
svg text { font-family: system-ui, "DejaVu Sans", sans-serif; }
.slice, .bar { color: inherit; display: block; } .slice image { image-rendering: pixelated; }
.frame { fill: none; stroke: currentColor; stroke-opacity: 0.45; } .tic { fill: currentColor; font-size: 11px; } .name { fill: currentColor; font-size: 12px; font-weight: 600; }
.slices { width: auto; } .slices th { color: var(--dim); font-weight: 500; font-size: 13px; width: 110px; vertical-align: middle; }
.slices td, .slices th { border: 0; padding: 2px 8px 2px 0; } .between td { text-align: center; font-size: 14px; padding-left: 40px; }
.bars { display: flex; flex-wrap: wrap; gap: 16px 40px; margin-top: 14px; }
code, pre { font: 13px/1.5 ui-monospace, "DejaVu Sans Mono", monospace; } code { overflow-wrap: anywhere; }
pre { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 12px 16px; overflow-x: auto; }
details { color: var(--dim); } footer { margin-top: 48px; color: var(--dim); font-size: 13px; }
@media (max-width: 720px) { .film { grid-template-columns: repeat(3, 1fr); } .plots { grid-template-columns: 1fr; } .pair { grid-template-columns: 1fr; } }
@media print { :root { color-scheme: light; } main { max-width: none; padding: 0; } section, figure, tr { break-inside: avoid; } details > * { display: block; } }
)css";

Result<> check(const ReportData& data) {
  if (data.field && data.field->truth && !(data.field->truth->grid == data.field->volume.grid)) {
    return invalid_input("truth and reconstruction have different grids", "their slices cannot be compared",
                         "resample the truth to the grid of the reconstruction");
  }
  return {};
}

Result<std::string> hero(const ReportData& data) {
  if (!data.field) return std::string();
  VolumePictureOptions options;
  options.title = "Reconstructed emission, " + data.field->label;
  options.unit = data.unit;
  const auto picture = volume_picture(data.field->volume, options);
  if (!picture) return tl::unexpected(picture.error());
  return concat("<figure class=\"hero\">", inline_image(*picture, options.title), "</figure>\n");
}

}  // namespace

Result<std::string> report_html(const ReportData& data) {
  if (auto ok = check(data); !ok) return tl::unexpected(ok.error());
  std::string body;
  Result<> failed;
  const auto add = [&](const Result<std::string>& part) {
    if (!failed) return;
    if (part) {
      body += *part;
    } else {
      failed = tl::unexpected(part.error());
    }
  };
  add(hero(data));
  add(headline_section(data));
  add(camera_images_section(data));
  add(film_section(data));
  add(slices_section(data));
  add(field_plots_section(data));
  add(residual_section(data));
  add(calibration_section(data));
  add(pulses_section(data));
  add(latency_section(data));
  add(receipt_section(data));
  add(repeat_section(data));
  if (!failed) return tl::unexpected(failed.error());
  return concat(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n",
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>",
      escaped(data.title), "</title>\n<style>", kStyle, "</style>\n</head>\n<body>\n<main>\n<header><h1>",
      escaped(data.title), "</h1>\n<p class=\"subtitle\">", escaped(data.subtitle),
      data.subtitle.empty() || data.created.empty() ? "" : " · ", escaped(data.created), "</p></header>\n",
      body, "<footer>Written by flamefield. Lengths in mm; y is the height above the burner (HAB).",
      "</footer>\n</main>\n</body>\n</html>\n");
}

Result<> write_report(const std::filesystem::path& path, const ReportData& data) {
  const auto html = report_html(data);
  if (!html) return tl::unexpected(html.error());
  return write_text_file(path, *html);
}

}  // namespace flamefield
