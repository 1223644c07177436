#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

struct sqlite3;
struct sqlite3_stmt;

namespace roadvec {

/// What is wrong with the map's file, as far as it decides what to do about it.
enum class StoreTrouble : std::uint8_t {
  full,        ///< no room: wait
  locked,      ///< another program holds a lock: wait
  unwritable,  ///< it cannot be opened or written: wait, open again
  replaced,    ///< its name belongs to another file now, or to none: open what is there
  damaged,     ///< not a database any more: set aside
  foreign,     ///< not a map of ours: set aside
  newer,       ///< of a later version: set aside
};
struct StoreError {
  StoreTrouble trouble = StoreTrouble::unwritable;
  std::string text;  ///< for a person
};
template <class T>
using Stored = tl::expected<T, StoreError>;
[[nodiscard]] inline tl::unexpected<StoreError> in_trouble(StoreTrouble trouble, std::string text) {
  return tl::unexpected<StoreError>(StoreError{trouble, std::move(text)});
}

/// A prepared statement. `execute(1, 2.5, "text")` binds values in order, runs it to its end and makes it ready again.
class Statement {
 public:
  template <class... Values>
  [[nodiscard]] Stored<void> execute(const Values&... values) {
    bind_all(values...);
    const Stored<bool> stepped = step();
    reset();
    if (!stepped) return tl::unexpected<StoreError>(stepped.error());
    return {};
  }
  /// Binds values for a query; its rows come with step().
  template <class... Values>
  void bind_all(const Values&... values) {
    [[maybe_unused]] int index = 0;
    (bind(++index, values), ...);
  }
  [[nodiscard]] Stored<bool> step();  ///< true: there is a row
  void reset();

  // Of the present row. What is NULL, or of another type, comes as 0 or empty, or as SQLite converts it.
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] double real(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] std::span<const std::uint8_t> blob(int column) const;  ///< valid until step() or reset()

 private:
  friend class Database;
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  void bind(int index, std::int64_t value);
  void bind(int index, double value);
  void bind(int index, std::string_view value);
  void bind(int index, std::span<const std::uint8_t> value);

  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

/// One connection to an SQLite file, for one thread.
class Database {
 public:
  enum class Mode : std::uint8_t { read, make };
  [[nodiscard]] static Stored<Database> open(const std::string& path, Mode mode);

  [[nodiscard]] Stored<void> run(const std::string& sql) const;             ///< statements without rows
  [[nodiscard]] Stored<std::int64_t> number(const std::string& sql) const;  ///< first column of the first row; or 0
  [[nodiscard]] Stored<std::string> text(const std::string& sql) const;     ///< the same; or empty
  [[nodiscard]] Stored<Statement> prepare(const std::string& sql) const;
  [[nodiscard]] bool is_read_only() const;
  /// The path no longer names the file that is open.
  [[nodiscard]] bool has_moved() const;
  [[nodiscard]] int changed_rows() const;  ///< by the last statement
  void roll_back() const;                  ///< if a transaction is open

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  std::unique_ptr<sqlite3, Close> database_;
};

}  // namespace roadvec
