#pragma once

#include <functional>

#include "services/store/h5.h"
#include "services/store/provenance.h"

namespace flamefield {

// An HDF5 file that appears whole under its name when `work` has filled it, or not at all.
Result<> write_h5(const std::filesystem::path& path, const std::function<Result<>(H5File&)>& work);

// entry/provenance, one text attribute each.
void write_provenance(H5Group& entry, const Provenance& provenance);

}  // namespace flamefield
