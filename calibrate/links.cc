#include "calibrate/links.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace flamefield {

// What groups of cameras hang together, apart from the connected one; each joined to it where neighbours
// meet.
std::vector<MissingLink> missing_links(const Sightings& sightings, const Connected& connected) {
  const std::size_t cameras = sightings.cameras.size();
  std::vector<std::size_t> part(cameras);
  for (std::size_t c = 0; c < cameras; ++c) part[c] = c;
  const auto merge = [&](std::size_t a, std::size_t b) {
    const std::size_t from = part[a], to = part[b];
    for (std::size_t& p : part) p = p == from ? to : p;
  };
  std::map<std::size_t, std::size_t> first_to_see;  // of each pose
  for (const Sightings::View& view : sightings.views) {
    if (view.detection->found())
      merge(view.camera, first_to_see.try_emplace(view.pose, view.camera).first->second);
  }
  const std::set<std::size_t> inside(connected.session_camera.begin(), connected.session_camera.end());
  std::map<std::size_t, std::pair<std::size_t, std::size_t>> nearest;  // of each part: inside, loose
  const auto apart = [](const auto& pair) {
    return pair.first > pair.second ? pair.first - pair.second : pair.second - pair.first;
  };
  for (std::size_t loose = 0; loose < cameras; ++loose) {
    if (inside.contains(loose)) continue;
    for (std::size_t c : inside) {
      const std::pair<std::size_t, std::size_t> link{c, loose};
      auto& best = nearest.try_emplace(part[loose], link).first->second;
      if (apart(link) < apart(best)) best = link;
    }
  }
  std::vector<MissingLink> links;
  for (const auto& [_, link] : nearest)
    links.push_back({sightings.cameras[link.first], sightings.cameras[link.second]});
  return links;
}

std::string advice_text(const std::vector<MissingLink>& links) {
  std::string out;
  for (const MissingLink& link : links)
    out += concat(out.empty() ? "" : ", ", link.connected, " and ", link.loose);
  return concat("take more board poses; show the board so that these see it at once: ", out);
}

std::string unseen_text(const Sightings& sightings) {
  std::string out;
  for (std::size_t c = 0; c < sightings.cameras.size(); ++c) {
    if (!sightings.found_by(c).empty()) continue;
    std::map<std::string, int> reasons;
    int images = 0;
    for (const Sightings::View& view : sightings.views) {
      if (view.camera != c) continue;
      ++images;
      ++reasons[view.detection->reason];
    }
    out += concat("; ", sightings.cameras[c]);
    if (images == 0) {
      out += " has no images";
      continue;
    }
    const auto most = std::ranges::max_element(reasons, {}, [](const auto& r) { return r.second; });
    out += concat(" saw no board in ", images, " images, ", most->second, " times for: ", most->first);
  }
  return out;
}

}  // namespace flamefield
