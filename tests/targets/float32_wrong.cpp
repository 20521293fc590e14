// What no library in float32 may do, for the test of the test (realtime_symbols.cmake).
namespace trocar {
double in_double(double x) { return x * x; }
}  // namespace trocar
