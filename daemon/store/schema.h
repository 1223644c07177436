#pragma once

#include "daemon/store/database.h"

namespace roadvec {

/// The tables of a map file: README.md in this folder says what each column means.
inline constexpr std::int64_t kSchemaVersion = 3;

/// Brings an empty file, or one of an earlier version, to `version`, in one transaction; a file of that version is left
/// as it is. Fails for files that are not ours (foreign) and for later versions (newer), which stay as they are.
[[nodiscard]] Stored<void> bring_up_to(const Database& database, std::int64_t version = kSchemaVersion);

}  // namespace roadvec
