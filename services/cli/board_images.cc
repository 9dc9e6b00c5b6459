#include "services/cli/board_images.h"

#include <algorithm>

#include "services/cli/app.h"
#include "services/store/frame_file.h"
#include "services/store/image_file.h"

namespace flamefield {

namespace {

void add_session(const std::filesystem::path& path, std::vector<BoardView>& views) {
  for (const FrameSet& set : or_fail(read_frames(path))) {
    if (set.kind != CaptureKind::Board) continue;
    for (const Frame& frame : set.frames)
      views.push_back({frame.camera, concat("pulse-", set.pulse), or_fail_about(path, grey_levels(frame))});
  }
}

void add_camera_folder(const std::filesystem::path& folder, std::vector<BoardView>& views) {
  for (const auto& image : or_fail(images_in(folder)))
    views.push_back({folder.filename().string(), image.stem().string(), or_fail(read_grey_image(image))});
}

std::vector<std::filesystem::path> folders_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> folders;
  std::error_code ignored;  // a folder that cannot be listed holds no pictures either
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
    if (entry.is_directory()) folders.push_back(entry.path());
  std::sort(folders.begin(), folders.end());
  return folders;
}

}  // namespace

std::vector<BoardView> read_board_views(const std::vector<std::filesystem::path>& paths) {
  std::vector<BoardView> views;
  for (const auto& given : paths) {
    if (given.extension() == ".nxs") {
      add_session(given, views);
      continue;
    }
    const auto path = given.has_filename() ? given : given.parent_path();
    const auto inner = folders_in(path);
    if (inner.empty()) add_camera_folder(path, views);
    for (const auto& folder : inner) add_camera_folder(folder, views);
  }
  if (views.empty()) {
    throw CommandFailure{ExitCode::Failed,
                         concat("no pictures in '", paths.front().string(),
                                "' (neither .png .jpg .tif .bmp .pgm nor board sets) name one folder "
                                "a camera")};
  }
  return views;
}

}  // namespace flamefield
