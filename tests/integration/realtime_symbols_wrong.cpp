// What no real-time library may do, for the test of the test (realtime_symbols.cmake).
#include <mutex>
#include <stdexcept>
#include <vector>

#include <time.h>

namespace trocar {

std::vector<int> allocates(std::size_t n) { return std::vector<int>(n); }
void throws() { throw std::runtime_error("no"); }
void locks(std::mutex& mutex) { mutex.lock(); }
void waits() {
  const timespec second{1, 0};
  (void)nanosleep(&second, nullptr);
}

}  // namespace trocar
