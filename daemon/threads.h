#pragma once

#include <string>

namespace roadvec {

/// Names the calling thread and, for priority > 0, makes it SCHED_FIFO on the given processor (-1: any). False when the
/// system does not let us: the thread then goes on as an ordinary one.
bool set_up_thread(const char* name, int fifo_priority, int cpu) noexcept;

/// Locks all memory, now and later, so that no real-time thread waits for a page. False when RLIMIT_MEMLOCK is in the
/// way.
bool lock_memory() noexcept;

}  // namespace roadvec
