#pragma once

#include <atomic>
#include <cstddef>

namespace roadvec::test {

/// Calls of operator new made by this thread since it began; other threads may read it while this one lives. Link
/// tests/support/allocation_count.cpp to have them counted.
[[nodiscard]] const std::atomic<std::size_t>& allocation_count() noexcept;

}  // namespace roadvec::test
