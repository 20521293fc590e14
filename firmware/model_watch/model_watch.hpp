// The model image of a running rig: a file that may be replaced at any time. A thread outside of the tick looks at it a few times a second,
// copies and verifies what is new, and offers it to the virtual needle, which takes it at a tick boundary. What is damaged, of another
// version or too large is refused by name, and the running model stays.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <list>
#include <string>
#include <thread>

#include "common/image_file/mapped_image.hpp"
#include "firmware/virtual_needle/virtual_needle.hpp"

namespace trocar::model_watch {

class ModelWatch {
 public:
  using Say = std::function<void(const std::string& line)>;  // called from the thread

  // Takes the image that is there now; throws config::UserError when it cannot be used. Start it before the real-time set-up: threads
  // inherit priority and core. `needle` outlives it.
  ModelWatch(std::filesystem::path file, virtual_needle::VirtualNeedle& needle, Say say);
  ~ModelWatch();
  ModelWatch(const ModelWatch&) = delete;
  ModelWatch& operator=(const ModelWatch&) = delete;

 private:
  struct Stamp {  // of the file: another one is another file, or was written since
    std::uint64_t device{}, inode{}, size{};
    std::int64_t modified_s{}, modified_ns{};
    bool operator==(const Stamp&) const = default;
  };
  [[nodiscard]] static Stamp stamp_of(const std::filesystem::path& file);
  void take();
  void look();
  void run();

  std::filesystem::path file_;
  virtual_needle::VirtualNeedle& needle_;
  Say say_;
  Stamp taken_{}, seen_{};
  // Newest last. An image stays until the needle uses a newer one: it may be taking any that was offered.
  std::list<image_file::MappedImage> images_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace trocar::model_watch
