#pragma once

#include <cstdio>
#include <cstdlib>

/// A contract: stays on in release. When it fails, the mistake is ours: say where and abort (core dump, systemd
/// restarts).
#define ENSURE(condition)                                                                 \
  do {                                                                                    \
    if (!(condition)) {                                                                   \
      std::fprintf(stderr, "%s:%d: ENSURE(%s) failed\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                       \
    }                                                                                     \
  } while (false)
