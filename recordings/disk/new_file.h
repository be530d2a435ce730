// A file gets its name when it is whole. Until then it lies beside its place under a name of its own
// (.ferrobench-*.part), so neither a failure, nor the death of the program, nor another writer costs what had
// the name before, and no link is followed.
#pragma once

#include <ostream>
#include <span>
#include <streambuf>
#include <string>
#include <string_view>

#include "base/error.h"
#include "recordings/disk/durable_file.h"

namespace ferrobench::recordings {

// What becomes of a file that has the name already. Devices, folders, pipes and links are never replaced.
enum class Existing { keep, replace };

// Error(busy): the name has gone to another file, which is kept.
class NameTaken : public Error {
 public:
  explicit NameTaken(const std::string& path, const std::string& hint = "choose another name");
};

class NewFile {
 public:
  // NameTaken, or Error(io_error | disk_full) if nothing can be put there.
  NewFile(std::string path, Existing existing);
  ~NewFile();  // without put() everything is as it was
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  void write(std::string_view bytes) { write_all(file_, bytes, path_); }
  const Descriptor& descriptor() const { return file_; }
  const std::string& path() const { return path_; }    // where it will be
  const std::string& draft() const { return draft_; }  // where it is until then
  // It is on the disk and has its name afterwards. Throws as the constructor does.
  void put();

 private:
  std::string path_, draft_;
  Existing existing_;
  Descriptor file_;
};

// What is written here is in the file after flush(). A failure is an Error out of the statement that meets
// it.
class FileStream : public std::ostream {
 public:
  explicit FileStream(NewFile& file);

 private:
  class Buffer : public std::streambuf {
   public:
    explicit Buffer(NewFile& file) : file_(file) {}

   private:
    int_type overflow(int_type c) override;
    std::streamsize xsputn(const char* bytes, std::streamsize count) override;
    int sync() override;

    NewFile& file_;
    std::string waiting_;
  };
  Buffer buffer_;
};

// To be asked before any work is done for a new file: makes one in its place, and removes it again. Error
// as from NewFile; Error(invalid_params) if it is one of the `sources` by whatever name, Error(busy) if a
// program is writing what would be replaced.
void demand_place(const std::string& path, Existing existing, std::span<const std::string> sources = {});

// Removes what programs that died have left of new files in the folder and those in it. Nothing that a live
// one is writing.
void remove_leftovers(const std::string& folder);

}  // namespace ferrobench::recordings
