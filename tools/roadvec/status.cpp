#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <thread>

#include "tools/roadvec/commands.h"
#include "tools/roadvec/json.h"

namespace roadvec {
namespace {

constexpr const char* kHomeAndClear = "\x1b[H\x1b[2J";

struct Answer {
  std::optional<wire::Status> status;
  Error error;
  int exit_code = kExitOk;
};

Answer ask(const Connection& connection) {
  Expected<MapClient> client = connect(connection);
  if (!client) return {std::nullopt, client.error(), kExitNoDaemon};
  if (auto sent = client->send(wire::GetStatus{}); !sent) return {std::nullopt, sent.error(), kExitFailure};
  Expected<wire::Status> status = client->receive_one<wire::Status>(MapClient::Seconds(connection.timeout_s));
  if (!status) return {std::nullopt, status.error(), kExitFailure};
  const bool as_it_should_be = status->state == "mapping";
  return {std::move(*status), {}, as_it_should_be ? kExitOk : kExitDegraded};
}

int show_once(const Connection& connection) {
  const Answer answer = ask(connection);
  if (!answer.status) return complain(answer.error, answer.exit_code);
  std::fputs((connection.json ? json_of(*answer.status) + "\n" : status_screen(*answer.status)).c_str(), stdout);
  return answer.exit_code;
}

}  // namespace

int show_status(const Connection& connection, const StatusChoice& choice) {
  if (!choice.watch) return show_once(connection);
  const bool clears = !connection.json && ::isatty(STDOUT_FILENO) != 0;
  // A daemon that is not there may come.
  while (std::ferror(stdout) == 0) {
    if (clears) std::fputs(kHomeAndClear, stdout);
    static_cast<void>(show_once(connection));
    if (!clears && !connection.json) std::fputs("\n", stdout);
    std::fflush(stdout);
    std::this_thread::sleep_for(std::chrono::duration<double>(choice.interval_s));
  }
  return kExitFailure;
}

}  // namespace roadvec
