#include "services/report/report.h"

#include "services/report/html.h"
#include "services/report/page.h"
#include "services/report/picture.h"
#include "services/report/report_sections.h"
#include "services/store/file.h"

namespace flamefield {
namespace {

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
  add(board_session_section(data));
  add(pulses_section(data));
  add(latency_section(data));
  add(receipt_section(data));
  add(repeat_section(data));
  if (!failed) return tl::unexpected(failed.error());
  return page(data.title,
              concat(data.subtitle, data.subtitle.empty() || data.created.empty() ? "" : " · ", data.created),
              body);
}

Result<> write_report(const std::filesystem::path& path, const ReportData& data) {
  const auto html = report_html(data);
  if (!html) return tl::unexpected(html.error());
  return write_text_file(path, *html);
}

}  // namespace flamefield
