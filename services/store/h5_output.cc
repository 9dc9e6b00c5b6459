#include "services/store/h5_output.h"

#include "services/store/file.h"

namespace flamefield {

Result<> write_h5(const std::filesystem::path& path, const std::function<Result<>(H5File&)>& work) {
  auto target = AtomicFile::create(path);
  if (!target) return tl::unexpected(target.error());
  const auto written = h5_result(path, "write", [&]() -> Result<> {
    H5File file = H5File::create(target->temporary_path());
    if (auto ok = work(file); !ok) return ok;
    file.flush();
    return {};
  });
  if (!written) return written;
  return target->commit();
}

void write_provenance(H5Group& entry, const Provenance& provenance) {
  H5Group origin = entry.create_group("provenance", "NXcollection");
  for (const auto& [key, value] : provenance) origin.set_text(key, value);
}

}  // namespace flamefield
