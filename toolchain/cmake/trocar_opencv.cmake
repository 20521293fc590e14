# OpenCV's module packages have no CMake configuration. They are linked to the camera's folders and nowhere else: with calib3d and imgcodecs
# a program maps some 130 shared objects more, which is why the camera's commands are a program of their own (host/camera/README.md).
find_path(TROCAR_OPENCV_INCLUDE opencv2/calib3d.hpp PATH_SUFFIXES opencv4 REQUIRED)
add_library(trocar_opencv INTERFACE)
target_include_directories(trocar_opencv SYSTEM INTERFACE ${TROCAR_OPENCV_INCLUDE})
foreach(module IN ITEMS calib3d imgcodecs imgproc core)
  find_library(TROCAR_OPENCV_${module} opencv_${module} REQUIRED)
  target_link_libraries(trocar_opencv INTERFACE ${TROCAR_OPENCV_${module}})
endforeach()
