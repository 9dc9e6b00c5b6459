#include "services/report/page.h"

#include "proto/error.h"
#include "services/report/html.h"

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
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(400px, 1fr)); gap: 24px 28px; margin: 14px 0; align-items: start; }
.figures svg { width: 100%; height: auto; max-width: 640px; display: block; } .figures .slice { width: auto; max-width: 100%; }
.row { display: flex; flex-wrap: wrap; gap: 20px 24px; grid-column: 1 / -1; } .row figure { max-width: 345px; }
.wide { margin-bottom: 30px; } .claim { max-width: 300px; } .why { color: var(--dim); font-size: 13px; max-width: 460px; }
@media (max-width: 720px) { .film { grid-template-columns: repeat(3, 1fr); } .plots, .figures { grid-template-columns: 1fr; } .pair { grid-template-columns: 1fr; } }
@media print { :root { color-scheme: light; } main { max-width: none; padding: 0; } section, figure, tr { break-inside: avoid; } details > * { display: block; } }
)css";

}  // namespace

std::string page(std::string_view title, std::string_view subtitle, std::string_view body) {
  return concat("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n",
                "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>",
                escaped(title), "</title>\n<style>", kStyle,
                "</style>\n</head>\n<body>\n<main>\n<header><h1>", escaped(title),
                "</h1>\n<p class=\"subtitle\">", escaped(subtitle), "</p></header>\n", body,
                "<footer>Written by flamefield. Lengths in mm; y is the height above the burner (HAB).",
                "</footer>\n</main>\n</body>\n</html>\n");
}

}  // namespace flamefield
