#pragma once

#include <chrono>
#include <optional>

#include "daemon/store/map_file.h"

namespace roadvec {

/// A part of the file that a start of roadvecd goes on with.
struct EarlierPart {
  MapPart part;
  Recollection drive;  ///< with guesses of where the vehicle is now, in the part's map frame
};

/// The longest of the parts that came by where the vehicle is now; none when no part did, or there is no file yet.
/// `start`: the start fix. `pause`: since the file was last written; after a short one the vehicle is near where it was
/// last, which a start fix that somebody wrote into the configuration may not be.
[[nodiscard]] Stored<std::optional<EarlierPart>> find_earlier_part(const std::filesystem::path& file,
                                                                   const Anchor& start, std::chrono::seconds pause);

}  // namespace roadvec
