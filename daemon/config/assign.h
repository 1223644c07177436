#pragma once

#include <filesystem>

#include "daemon/config/document.h"
#include "daemon/config/fields.h"

namespace roadvec {

/// Puts the document's value for `field` into its target, after checking type, range, names and files; else objects.
void assign(const Field& field, const toml::node& value, const std::filesystem::path& folder, ConfigContext context,
            ConfigDocument& document);

}  // namespace roadvec
