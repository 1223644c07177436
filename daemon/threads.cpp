#include "daemon/threads.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

namespace roadvec {

bool set_up_thread(const char* name, int fifo_priority, int cpu) noexcept {
  ::pthread_setname_np(::pthread_self(), name);
  bool done = true;
  if (cpu >= 0) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(static_cast<std::size_t>(cpu), &cpus);
    done = ::pthread_setaffinity_np(::pthread_self(), sizeof cpus, &cpus) == 0;
  }
  if (fifo_priority > 0) {
    const sched_param parameters{.sched_priority = fifo_priority};
    done = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters) == 0 && done;
  }
  return done;
}

bool lock_memory() noexcept { return ::mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0; }

}  // namespace roadvec
