#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/can/dbc.h"

namespace roadvec {
namespace {

constexpr std::size_t kNearNames = 3;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

/// Insertions, deletions and replacements of a character that turn one name into the other; case does not count.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (lower(a[i]) == lower(b[j]) ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

/// "; near it: A, B, C" from all names there are.
std::string near_names(std::string_view wanted, const std::vector<std::string_view>& names) {
  std::vector<std::pair<std::size_t, std::string_view>> ranked;
  ranked.reserve(names.size());
  for (const std::string_view name : names) ranked.emplace_back(edit_distance(wanted, name), name);
  std::sort(ranked.begin(), ranked.end());
  ranked.erase(std::unique(ranked.begin(), ranked.end()), ranked.end());
  if (ranked.size() > kNearNames) ranked.resize(kNearNames);
  std::string text = ranked.empty() ? "; it has none" : "; near it: ";
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    if (i > 0) text += ", ";
    text += ranked[i].second;
  }
  return text;
}

template <class Item>
std::vector<std::string_view> names_of(const std::vector<Item>& items) {
  std::vector<std::string_view> names;
  names.reserve(items.size());
  for (const Item& item : items) names.push_back(item.name);
  return names;
}

}  // namespace

Expected<DbcSignalRef> find_signal(const DbcFile& file, std::string_view message_dot_signal) {
  const std::size_t dot = message_dot_signal.find('.');
  const std::string quoted = "'" + std::string(message_dot_signal) + "'";
  if (dot == std::string_view::npos) return fail(quoted + " does not name a signal: write Message.Signal");
  const std::string_view message_name = message_dot_signal.substr(0, dot);
  const std::string_view signal_name = message_dot_signal.substr(dot + 1);
  const DbcMessage* seen = nullptr;
  for (const DbcMessage& message : file.messages) {
    if (message.name != message_name) continue;
    seen = &message;
    for (const DbcSignal& signal : message.signals) {
      if (signal.name == signal_name) return DbcSignalRef{&message, &signal};
    }
  }
  if (seen == nullptr) {
    return fail(file.name + " has no message for " + quoted + near_names(message_name, names_of(file.messages)));
  }
  return fail(file.name + " has no signal for " + quoted + " in message " + seen->name +
              near_names(signal_name, names_of(seen->signals)));
}

}  // namespace roadvec
