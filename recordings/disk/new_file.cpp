#include "recordings/disk/new_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <random>

namespace ferrobench::recordings {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view draft_begin = ".ferrobench-", draft_end = ".part";
constexpr std::size_t stream_bytes = 1u << 16;  // bytes of a stream that are written together

std::string draft_name() {
  std::random_device random;
  std::array<char, 20> digits{};
  (void)std::snprintf(digits.data(), digits.size(), "%08x%08x", random(), random());
  return std::string(draft_begin) + digits.data() + std::string(draft_end);
}

bool is_draft(const std::string& name) {
  return name.starts_with(draft_begin) && name.ends_with(draft_end);
}

const char* kind_of(const struct stat& info) {
  if (S_ISLNK(info.st_mode)) return "is a symbolic link";
  if (S_ISDIR(info.st_mode)) return "is a folder";
  if (S_ISFIFO(info.st_mode)) return "is a pipe";
  if (S_ISSOCK(info.st_mode)) return "is a socket";
  return "is a device";
}

// What has the name now, if it may be replaced.
std::optional<struct stat> named(const std::string& path, Existing existing) {
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) {
    if (errno == ENOENT) return std::nullopt;
    throw_write_failure(path, errno);
  }
  if (!S_ISREG(info.st_mode)) {
    std::error_code ignored;
    const auto target = S_ISLNK(info.st_mode) ? fs::read_symlink(path, ignored).string() : "";
    throw Error(
        ErrorCode::io_error, "a file cannot be put there",
        Problem{.message = kind_of(info),
                .given = path,
                .hint = target.empty() ? "name a file" : "name the file that it leads to: " + target});
  }
  if (existing == Existing::keep) throw NameTaken(path);
  if (faccessat(AT_FDCWD, path.c_str(), W_OK, AT_EACCESS) != 0) throw_write_failure(path, errno);
  return info;
}

// 0 or the errno; EEXIST if the name is taken.
int rename_to_free(const std::string& from, const std::string& to) {
  if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL && errno != ENOSYS) return errno;
  if (link(from.c_str(), to.c_str()) != 0) return errno;  // of file systems that know no better
  unlink(from.c_str());
  return 0;
}

int rename_over(const std::string& from, const std::string& to) {
  return std::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace

NameTaken::NameTaken(const std::string& path, const std::string& hint)
    : Error(ErrorCode::busy, "a file of this name is there already",
            Problem{.message = "would be replaced", .given = path, .hint = hint}) {}

NewFile::NewFile(std::string path, Existing existing) : path_(std::move(path)), existing_(existing) {
  named(path_, existing_);
  const auto folder = folder_of(path_);
  do {
    draft_ = folder + "/" + draft_name();
    file_ = create_locked(draft_, LockFailure::ignore);
  } while (!file_ && errno == EEXIST);
  if (!file_) throw_write_failure(path_, errno);
}

NewFile::~NewFile() {
  if (!draft_.empty()) unlink(draft_.c_str());
}

void NewFile::put() {
  if (const int error = sync_data(file_)) throw_write_failure(path_, error);
  if (const auto before = named(path_, existing_)) {  // whoever could read it and nobody else still can
    (void)fchmod(file_.get(), before->st_mode & 0777);
    (void)!fchown(file_.get(), before->st_uid, before->st_gid);
  }
  const int error = existing_ == Existing::keep ? rename_to_free(draft_, path_) : rename_over(draft_, path_);
  if (error == EEXIST) throw NameTaken(path_);
  if (error != 0) throw_write_failure(path_, error);
  draft_.clear();
  try {
    sync_folder_of(path_);
  } catch (const Error&) {  // a name that the next power cut may take is not given
    if (existing_ == Existing::keep) unlink(path_.c_str());
    throw;
  }
}

FileStream::FileStream(NewFile& file) : std::ostream(nullptr), buffer_(file) {
  rdbuf(&buffer_);
  exceptions(std::ios::badbit);
}

auto FileStream::Buffer::overflow(int_type c) -> int_type {
  const char byte = traits_type::to_char_type(c);
  if (c != traits_type::eof()) xsputn(&byte, 1);
  return traits_type::not_eof(c);
}

std::streamsize FileStream::Buffer::xsputn(const char* bytes, std::streamsize count) {
  waiting_.append(bytes, static_cast<std::size_t>(count));
  if (waiting_.size() >= stream_bytes) sync();
  return count;
}

int FileStream::Buffer::sync() {
  file_.write(waiting_);
  waiting_.clear();
  return 0;
}

void demand_place(const std::string& path, Existing existing, std::span<const std::string> sources) {
  for (const auto& source : sources) {
    std::error_code none;
    if (fs::equivalent(source, path, none))
      throw Error(
          ErrorCode::invalid_params, "the output would replace its source",
          Problem{.message = "is the same file as " + source, .given = path, .hint = "choose another name"});
  }
  const NewFile trial(path, existing);
  const auto before = open_file(path, O_RDONLY | O_NONBLOCK | O_NOFOLLOW);
  if (before && is_locked(before))
    throw Error(ErrorCode::busy, "a program is writing this file",
                Problem{.given = path, .hint = "wait for its end, or choose another name"});
}

void remove_leftovers(const std::string& folder) {
  std::error_code failure, ignored;
  fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, failure), end;
  for (; !failure && entry != end; entry.increment(failure)) {
    if (!is_draft(entry->path().filename().string()) || !fs::is_regular_file(entry->symlink_status(ignored)))
      continue;
    const auto path = entry->path().string();
    const auto file = open_file(path, O_RDWR | O_NONBLOCK | O_NOFOLLOW);
    if (file && try_lock(file)) unlink(path.c_str());
  }
}

}  // namespace ferrobench::recordings
