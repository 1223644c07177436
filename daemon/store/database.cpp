#include "daemon/store/database.h"

#include <sqlite3.h>

#include <optional>

namespace roadvec {
namespace {

/// A foreign reader or a checkpoint is through within this; whoever takes longer makes us say so and try again.
constexpr int kBusyTimeout_ms = 500;

StoreTrouble trouble_of(int code) {
  switch (code & 0xFF) {
    case SQLITE_FULL:
      return StoreTrouble::full;
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return StoreTrouble::locked;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return StoreTrouble::damaged;
    case SQLITE_ERROR:  // a table or column is missing
      return StoreTrouble::foreign;
    default:
      return StoreTrouble::unwritable;
  }
}

tl::unexpected<StoreError> error_of(sqlite3* database) {
  return in_trouble(trouble_of(sqlite3_extended_errcode(database)), sqlite3_errmsg(database));
}

/// To the end, whatever is wanted: a PRAGMA that is dropped after its row has not let go of its lock.
template <class T, class Read>
Stored<T> first_row(const Database& database, const std::string& sql, Read&& read) {
  Stored<Statement> statement = database.prepare(sql);
  if (!statement) return tl::unexpected<StoreError>(statement.error());
  std::optional<T> value;
  for (;;) {
    const Stored<bool> row = statement->step();
    if (!row) return tl::unexpected<StoreError>(row.error());
    if (!*row) return value.value_or(T{});
    if (!value) value = read(*statement);
  }
}

}  // namespace

void Statement::Finalize::operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
void Database::Close::operator()(sqlite3* database) const { sqlite3_close_v2(database); }

Stored<bool> Statement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return error_of(sqlite3_db_handle(statement_.get()));
}

void Statement::reset() { sqlite3_reset(statement_.get()); }

void Statement::bind(int index, std::int64_t value) { sqlite3_bind_int64(statement_.get(), index, value); }
void Statement::bind(int index, double value) { sqlite3_bind_double(statement_.get(), index, value); }
void Statement::bind(int index, std::string_view value) {
  sqlite3_bind_text64(statement_.get(), index, value.data(), value.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
}
void Statement::bind(int index, std::span<const std::uint8_t> value) {
  if (value.empty()) {  // else it would be NULL
    sqlite3_bind_zeroblob(statement_.get(), index, 0);
    return;
  }
  sqlite3_bind_blob64(statement_.get(), index, value.data(), value.size(), SQLITE_TRANSIENT);
}

std::int64_t Statement::integer(int column) const { return sqlite3_column_int64(statement_.get(), column); }
double Statement::real(int column) const { return sqlite3_column_double(statement_.get(), column); }
std::string Statement::text(int column) const {
  const auto* text = sqlite3_column_text(statement_.get(), column);
  const auto bytes = static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column));
  return text == nullptr ? std::string() : std::string(reinterpret_cast<const char*>(text), bytes);
}
std::span<const std::uint8_t> Statement::blob(int column) const {
  const auto* bytes = static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_.get(), column));
  return {bytes, bytes == nullptr ? 0 : static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

Stored<Database> Database::open(const std::string& path, Mode mode) {
  sqlite3* raw = nullptr;
  const int flags = mode == Mode::read ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  const int code = sqlite3_open_v2(path.c_str(), &raw, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  Database database;
  database.database_.reset(raw);
  if (code != SQLITE_OK) return in_trouble(trouble_of(code), raw == nullptr ? "out of memory" : sqlite3_errmsg(raw));
  sqlite3_busy_timeout(raw, kBusyTimeout_ms);
  // The log goes into the file when we say so, and not when a connection ends that has found out that the file is
  // another.
  sqlite3_db_config(raw, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  return database;
}

Stored<void> Database::run(const std::string& sql) const {
  if (sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK) return {};
  return error_of(database_.get());
}

Stored<Statement> Database::prepare(const std::string& sql) const {
  sqlite3_stmt* raw = nullptr;
  if (sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &raw, nullptr) != SQLITE_OK)
    return error_of(database_.get());
  Statement statement;
  statement.statement_.reset(raw);
  return statement;
}

Stored<std::int64_t> Database::number(const std::string& sql) const {
  return first_row<std::int64_t>(*this, sql, [](const Statement& row) { return row.integer(0); });
}

Stored<std::string> Database::text(const std::string& sql) const {
  return first_row<std::string>(*this, sql, [](const Statement& row) { return row.text(0); });
}

bool Database::is_read_only() const { return sqlite3_db_readonly(database_.get(), "main") == 1; }

bool Database::has_moved() const {
  int moved = 0;
  sqlite3_file_control(database_.get(), "main", SQLITE_FCNTL_HAS_MOVED, &moved);
  return moved != 0;
}

int Database::changed_rows() const { return sqlite3_changes(database_.get()); }

void Database::roll_back() const {
  if (sqlite3_get_autocommit(database_.get()) == 0)
    sqlite3_exec(database_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
}

}  // namespace roadvec
