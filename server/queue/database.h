// SQLite with what this program needs of it: statements that are prepared once, values bound and read by
// their types, transactions that undo themselves. A failure is Error(disk_full | io_error) with the file's
// name. For one thread at a time.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>

struct sqlite3;
struct sqlite3_stmt;

namespace ferrobench::server {

class Database {
 public:
  // Makes the file if there is none. What is committed is on the disk. Another process that has the file is
  // waited for, 5 s at most.
  explicit Database(const std::string& path);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  // The rows of a statement under way, which ends with it.
  class Rows {
   public:
    Rows(Database& database, sqlite3_stmt* statement) : database_(database), statement_(statement) {}
    ~Rows();
    Rows(const Rows&) = delete;
    Rows& operator=(const Rows&) = delete;
    bool next();  // the first one, the one after
    std::int64_t whole(int column) const;
    std::string text(int column) const;  // "" for null

   private:
    Database& database_;
    sqlite3_stmt* statement_;
  };

  // `sql` has a "?" for each of the values: whole numbers and texts.
  template <class... Values>
  Rows query(std::string_view sql, const Values&... values) {
    auto* statement = prepared(sql);
    int at = 0;
    (bind(statement, ++at, values), ...);
    return {*this, statement};
  }
  // Without a result: how many rows it changed.
  template <class... Values>
  std::int64_t change(std::string_view sql, const Values&... values) {
    query(sql, values...).next();
    return changes();
  }
  void execute(const std::string& sql);  // several statements, without values
  std::int64_t last_id() const;

  // All or nothing: undone unless it was committed.
  class Transaction {
   public:
    explicit Transaction(Database& database) : database_(database) { database_.execute("BEGIN IMMEDIATE"); }
    ~Transaction();
    Transaction(const Transaction&) = delete;
    Transaction& operator=(const Transaction&) = delete;
    void commit();

   private:
    Database& database_;
    bool open_ = true;
  };

 private:
  struct Close {
    void operator()(sqlite3* connection) const;
  };
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  sqlite3_stmt* prepared(std::string_view sql);
  void bind(sqlite3_stmt* statement, int at, std::int64_t value);
  void bind(sqlite3_stmt* statement, int at, const std::string& value);
  std::int64_t changes() const;
  [[noreturn]] void fail() const;

  std::string path_;
  std::unique_ptr<sqlite3, Close> connection_;
  std::map<std::string, std::unique_ptr<sqlite3_stmt, Finalize>, std::less<>> statements_;
};

}  // namespace ferrobench::server
