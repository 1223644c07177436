// Preloaded into User-Mode Linux by run.sh. Its kernel keeps 2 KiB of a process's extended registers; a processor with
// AMX has 11 KiB, and the host takes back all of them or nothing (EFAULT). Here the rest is added, marked as unused.

#include <cpuid.h>
#include <dlfcn.h>
#include <elf.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

#include <array>
#include <cstdarg>
#include <cstdint>
#include <cstring>

namespace {

using Ptrace = long (*)(int request, pid_t process, void* address, void* data);

constexpr std::size_t kInUseAt = 512;  // XSTATE_BV: a bit per component that is not in its first state

/// The components that lie within `size` bytes.
std::uint64_t components_within(std::size_t size) {
  std::uint64_t within = 3;  // x87 and SSE: in the part that every processor has
  for (unsigned i = 2; i < 63; ++i) {
    unsigned length = 0, offset = 0, c = 0, d = 0;
    __cpuid_count(0xD, i, length, offset, c, d);
    if (length > 0 && offset > 0 && offset + length <= size) within |= std::uint64_t{1} << i;
  }
  return within;
}

/// How many bytes the host wants.
std::size_t host_size(Ptrace next, pid_t process, void* address) {
  static std::size_t size = 0;
  static std::array<char, 65536> area;
  iovec piece{area.data(), area.size()};
  if (size == 0 && next(PTRACE_GETREGSET, process, address, &piece) == 0) size = piece.iov_len;
  return size;
}

}  // namespace

extern "C" long ptrace(__ptrace_request request, ...) {
  va_list rest;
  va_start(rest, request);
  const pid_t process = va_arg(rest, pid_t);
  void* const address = va_arg(rest, void*);
  void* const data = va_arg(rest, void*);
  va_end(rest);
  static const auto next = reinterpret_cast<Ptrace>(dlsym(RTLD_NEXT, "ptrace"));
  if (request != PTRACE_SETREGSET || reinterpret_cast<std::uintptr_t>(address) != NT_X86_XSTATE) {
    return next(request, process, address, data);
  }
  static std::array<char, 65536> area;
  const iovec given = *static_cast<iovec*>(data);
  const std::size_t size = host_size(next, process, address);
  if (given.iov_len < kInUseAt + 8 || given.iov_len >= size || size > area.size()) {
    return next(request, process, address, data);
  }
  area.fill(0);
  std::memcpy(area.data(), given.iov_base, given.iov_len);
  std::uint64_t in_use = 0;
  std::memcpy(&in_use, area.data() + kInUseAt, sizeof in_use);
  // Asked once: in a virtual machine each question is a trip to the hypervisor, and this is called thousands of times a
  // second.
  static const std::uint64_t kept = components_within(given.iov_len);
  in_use &= kept;
  std::memcpy(area.data() + kInUseAt, &in_use, sizeof in_use);
  iovec whole{area.data(), size};
  return next(request, process, address, &whole);
}
