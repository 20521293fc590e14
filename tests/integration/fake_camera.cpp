// A GigE Vision camera on the loopback interface, by Aravis: 320 x 240, 50 frames a second. Prints a line when it answers; ends with the
// process that started it.
#include <arv.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>

int main() {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  ArvGvFakeCamera* camera = arv_gv_fake_camera_new("127.0.0.1", "GV01");
  if (camera == nullptr || !arv_gv_fake_camera_is_running(camera)) {
    std::puts("fake_camera: cannot listen on 127.0.0.1");
    return 1;
  }
  ArvFakeCamera* inner = arv_gv_fake_camera_get_fake_camera(camera);
  arv_fake_camera_write_register(inner, ARV_FAKE_CAMERA_REGISTER_WIDTH, 320);
  arv_fake_camera_write_register(inner, ARV_FAKE_CAMERA_REGISTER_HEIGHT, 240);
  std::puts("fake_camera: ready");
  std::fflush(stdout);
  while (true) pause();
}
