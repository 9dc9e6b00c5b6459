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

void add_picture(const std::filesystem::path& picture, const Rig* rig, std::vector<BoardView>& views) {
  const std::string name = picture.stem().string();
  Image image = or_fail(read_grey_image(picture));
  if (rig && rig->find(name)) {
    views.push_back({name, "only", std::move(image)});
  } else {
    const auto folder = std::filesystem::absolute(picture).parent_path();
    views.push_back({folder.filename().string(), name, std::move(image)});
  }
}

void add_folder(const std::filesystem::path& folder, const Rig* rig, std::vector<BoardView>& views) {
  for (const auto& picture : or_fail(images_in(folder))) add_picture(picture, rig, views);
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

std::vector<BoardView> read_board_views(const std::vector<std::filesystem::path>& paths, const Rig* rig) {
  std::vector<BoardView> views;
  std::error_code ignored;  // reading says it better
  for (const auto& given : paths) {
    if (given.extension() == ".nxs") {
      add_session(given, views);
      continue;
    }
    if (std::filesystem::is_regular_file(given, ignored)) {
      add_picture(given, rig, views);
      continue;
    }
    const auto path = given.has_filename() ? given : given.parent_path();
    const auto inner = folders_in(path);
    if (inner.empty()) add_folder(path, rig, views);
    for (const auto& folder : inner) add_folder(folder, rig, views);
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
