#include "services/study/figures.h"

#include "services/report/html.h"

namespace flamefield {

Result<std::string> figure_html(const StudyFigure& figure, const FigureSource& source) {
  switch (figure.kind) {
    case FigureKind::Paths:
      return paths_figure(figure, source);
    case FigureKind::Errors:
      return errors_figure(figure, source);
    case FigureKind::Slices:
      return slices_figure(figure, source);
    case FigureKind::Height:
      return height_figure(figure, source);
    case FigureKind::Scatter:
      return scatter_figure(figure, source);
    case FigureKind::Masks:
      return masks_figure(figure, source);
    case FigureKind::Stability:
      return stability_figure(figure, source);
  }
  return std::string();
}

std::string caption_of(const StudyFigure& figure, const std::string& more) {
  std::string out = figure.paper.empty() ? "" : concat("As ", figure.paper, " of the article. ");
  out += figure.caption;
  if (!more.empty()) out += concat(out.empty() ? "" : " ", more);
  return out;
}

void style(Series& series, std::size_t index) {
  constexpr std::array kColours = {kBlue, kOrange, kGreen, kRed, "#8e6bbd", kGrey};
  series.colour = kColours[index % kColours.size()];
  if (series.mark == Mark::Line && index % 2 == 1) series.mark = Mark::Dashed;
}

}  // namespace flamefield
