#include "server/queue/database.h"

#include <sqlite3.h>

#include "base/error.h"

namespace ferrobench::server {

namespace {

constexpr int patience_ms = 5000;  // with another process that writes

}  // namespace

void Database::Close::operator()(sqlite3* connection) const {
  sqlite3_close_v2(connection);
}

void Database::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

Database::Database(const std::string& path) : path_(path) {
  sqlite3* connection = nullptr;
  const int opened = sqlite3_open_v2(
      path.c_str(), &connection,
      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOFOLLOW | SQLITE_OPEN_FULLMUTEX, nullptr);
  connection_.reset(connection);
  if (opened != SQLITE_OK) fail();
  sqlite3_busy_timeout(connection, patience_ms);
  sqlite3_extended_result_codes(connection, 1);
  // A file from elsewhere may hold anything: no schema of it calls functions, and none is trusted.
  sqlite3_db_config(connection, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(connection, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  // With FULL a commit is on the disk when it returns, also with a write-ahead log.
  execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON");
}

Database::~Database() = default;

void Database::fail() const {
  const int code = connection_ ? sqlite3_errcode(connection_.get()) : SQLITE_NOMEM;
  const std::string why = connection_ ? sqlite3_errmsg(connection_.get()) : sqlite3_errstr(code);
  const int kind = code & 0xff;
  const bool damaged = kind == SQLITE_CORRUPT || kind == SQLITE_NOTADB;
  throw Error(kind == SQLITE_FULL ? ErrorCode::disk_full : ErrorCode::io_error,
              damaged ? "the queue's file is damaged" : "the queue's file cannot be used",
              Problem{.message = why,
                      .given = path_,
                      .hint = damaged               ? "move it away; recordings do not need it"
                              : kind == SQLITE_FULL ? "make room on the disk"
                                                    : "see that the daemon may write there"});
}

sqlite3_stmt* Database::prepared(std::string_view sql) {
  auto found = statements_.find(sql);
  if (found == statements_.end()) {
    sqlite3_stmt* made = nullptr;
    if (sqlite3_prepare_v2(connection_.get(), sql.data(), static_cast<int>(sql.size()), &made, nullptr) !=
        SQLITE_OK)
      fail();
    found = statements_.emplace(sql, made).first;
  }
  return found->second.get();
}

void Database::bind(sqlite3_stmt* statement, int at, std::int64_t value) {
  if (sqlite3_bind_int64(statement, at, value) != SQLITE_OK) fail();
}

void Database::bind(sqlite3_stmt* statement, int at, const std::string& value) {
  if (sqlite3_bind_text64(statement, at, value.data(), value.size(), SQLITE_TRANSIENT, SQLITE_UTF8) !=
      SQLITE_OK)
    fail();
}

std::int64_t Database::changes() const {
  return sqlite3_changes(connection_.get());
}

void Database::execute(const std::string& sql) {
  if (sqlite3_exec(connection_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) fail();
}

std::int64_t Database::last_id() const {
  return sqlite3_last_insert_rowid(connection_.get());
}

Database::Rows::~Rows() {
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

bool Database::Rows::next() {
  const int stepped = sqlite3_step(statement_);
  if (stepped == SQLITE_ROW) return true;
  if (stepped != SQLITE_DONE) database_.fail();
  return false;
}

std::int64_t Database::Rows::whole(int column) const {
  return sqlite3_column_int64(statement_, column);
}

std::string Database::Rows::text(int column) const {
  const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  return bytes == nullptr
             ? ""
             : std::string(bytes, static_cast<std::size_t>(sqlite3_column_bytes(statement_, column)));
}

Database::Transaction::~Transaction() {
  if (!open_) return;
  try {
    database_.execute("ROLLBACK");
  } catch (const Error&) {  // SQLite has undone it already
  }
}

void Database::Transaction::commit() {
  database_.execute("COMMIT");
  open_ = false;
}

}  // namespace ferrobench::server
