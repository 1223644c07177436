#include "daemon/config/document.h"

#include <algorithm>

namespace roadvec {

Expected<ConfigDocument> ConfigDocument::parse(std::string_view text, const std::string& name) {
  ConfigDocument document;
  document.name_ = name;
  try {  // the packaged library reports by exception; it ends here
    document.root_ = toml::parse(text);
  } catch (const toml::parse_error& error) {
    const unsigned line = std::max(1U, static_cast<unsigned>(error.source().begin.line));
    return fail(name + ":" + std::to_string(line) + ": not valid TOML: " + std::string(error.description()) +
                "; correct this line");
  }
  return document;
}

const toml::node* ConfigDocument::find(std::string_view key) const {
  const toml::node* node = &root_;
  for (std::size_t begin = 0; begin <= key.size();) {
    const std::size_t end = std::min(key.find('.', begin), key.size());
    const toml::table* table = node->as_table();
    node = table ? table->get(key.substr(begin, end - begin)) : nullptr;
    if (!node) return nullptr;
    begin = end + 1;
  }
  return node;
}

void ConfigDocument::object(std::string_view key, const std::string& what_and_remedy, const toml::node* value) {
  std::string_view place = key;
  const toml::node* node = value ? value : find(place);
  while (!node && place.find('.') != std::string_view::npos) {
    place = place.substr(0, place.rfind('.'));
    node = find(place);
  }
  const unsigned line = node ? std::max(1U, static_cast<unsigned>(node->source().begin.line)) : 1U;
  problems_.emplace_back(line, "key '" + std::string(key) + "': " + what_and_remedy);
}

Error ConfigDocument::error() const {
  auto sorted = problems_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string text;
  for (const auto& [line, problem] : sorted) {
    text += (text.empty() ? "" : "\n") + name_ + ":" + std::to_string(line) + ": " + problem;
  }
  return {text};
}

}  // namespace roadvec
