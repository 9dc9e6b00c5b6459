#pragma once

#include <string>

#include "services/report/plot.h"
#include "services/study/record.h"
#include "services/study/results.h"
#include "services/study/scene.h"

namespace flamefield {

// What figures draw from: the runs of one study, their volumes, and the fields they should have found.
struct FigureSource {
  const StudyResults& results;
  const RecordStore& store;
  StudyScenes& scenes;
  std::string name;  // unique in the page
};

// Marked-up figures; empty when there is nothing to draw yet.
Result<std::string> figure_html(const StudyFigure& figure, const FigureSource& source);

// One function each, as the paper's figures.
Result<std::string> paths_figure(const StudyFigure& figure, const FigureSource& source);      // 5, 6a, 7a
Result<std::string> errors_figure(const StudyFigure& figure, const FigureSource& source);     // 6b, 7b
Result<std::string> slices_figure(const StudyFigure& figure, const FigureSource& source);     // 8, 9, 11
Result<std::string> height_figure(const StudyFigure& figure, const FigureSource& source);     // 16
Result<std::string> scatter_figure(const StudyFigure& figure, const FigureSource& source);    // 17
Result<std::string> masks_figure(const StudyFigure& figure, const FigureSource& source);      // 3
Result<std::string> stability_figure(const StudyFigure& figure, const FigureSource& source);  // Section 3.5

// "Fig. 5a. The caption, and what was drawn."
std::string caption_of(const StudyFigure& figure, const std::string& more = {});

// Lines that everyone can tell apart, by colour and by dashes.
void style(Series& series, std::size_t index);

}  // namespace flamefield
