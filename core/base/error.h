#pragma once

#include <string>
#include <tl/expected.hpp>

namespace roadvec {

/// Why a slow-path operation (open, read, parse) failed: one line for a person, with the file, line or key and the
/// remedy.
struct Error {
  std::string message;
};

template <class T>
using Expected = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> fail(std::string message) {
  return tl::unexpected<Error>(Error{std::move(message)});
}

}  // namespace roadvec
