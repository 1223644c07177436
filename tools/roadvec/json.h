#pragma once

#include <string>

#include "core/wire/messages.h"

namespace roadvec {

// Messages as one line of JSON each: names and units are those of roadvec.proto; enums are lower-case words.
[[nodiscard]] std::string json_of(const Tile& tile);
[[nodiscard]] std::string json_of(const wire::Status& status);
[[nodiscard]] std::string json_of(const wire::Delta& delta);
[[nodiscard]] std::string json_of(const wire::EpochChange& change);
[[nodiscard]] std::string json_of(const wire::Pose& pose);
[[nodiscard]] std::string json_of(const wire::CommandResult& result);

}  // namespace roadvec
