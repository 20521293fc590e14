# Debian packages: what goes where after installation, and CPack. `./run package` makes them; README.md says what they are.
#   trocar-rig      the controller, its rig files, and what a rig's PC needs to run it as a service
#   trocar          host and simulated rig; needs trocar-rig, which `trocar demo` and `trocar rig check` start
#   trocar-camera   the camera's commands, apart because of the hundred libraries behind OpenCV
set(TROCAR_PACKAGE_VERSION ${PROJECT_VERSION} CACHE STRING "version of the Debian packages")
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # ./run package has built the programs; the tests need not be
set(here ${CMAKE_CURRENT_LIST_DIR})
set(made ${CMAKE_BINARY_DIR}/packaging)

install(TARGETS trocar-rig COMPONENT rig)
install(TARGETS trocar trocar-plant trocar-bench COMPONENT host)
install(TARGETS trocar-camera COMPONENT camera)
set(share ${CMAKE_SOURCE_DIR}/host/share)
install(DIRECTORY ${share}/rigs DESTINATION share/trocar COMPONENT rig)
foreach(kind IN ITEMS experiments hands needles plants scenes)
  install(DIRECTORY ${share}/${kind} DESTINATION share/trocar COMPONENT host)
endforeach()
install(DIRECTORY ${share}/cameras DESTINATION share/trocar COMPONENT camera)

install(FILES ${here}/trocar-rig.service ${here}/trocar-can@.service DESTINATION lib/systemd/system COMPONENT rig)
install(FILES ${here}/60-trocar.rules DESTINATION lib/udev/rules.d COMPONENT rig)
install(FILES ${here}/limits.conf DESTINATION /etc/security/limits.d RENAME trocar.conf COMPONENT rig)
install(FILES ${here}/rig.conf DESTINATION /etc/trocar COMPONENT rig)
set(linux ${CMAKE_SOURCE_DIR}/firmware/targets/linux)
install(FILES ${linux}/BARE_PC.md ${linux}/REALTIME.md ${CMAKE_SOURCE_DIR}/common/wire/SECURITY.md
  DESTINATION share/doc/trocar-rig COMPONENT rig)

# What Debian asks of every package. gzip without time and name: the same bytes each time.
string(TIMESTAMP year "%Y" UTC)
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
set(maintainer "The trocar authors <maintainers@trocar.invalid>")
foreach(component IN ITEMS rig host camera)
  set(package trocar-${component})
  set(comment)
  if(component STREQUAL host)
    set(package trocar)
    set(comment "\nComment:\n Loads CHOLMOD, whose supernodal module is under the GPL (2 or later): these programs may be passed on under its terms.\n")
  elseif(component STREQUAL camera)
    set(comment "\nComment:\n Loads Debian's OpenCV, and poppler (GPL, 2 or later) with it: this program may be passed on under its terms.\n")
  endif()
  set(COPYRIGHT_COMMENT ${comment})
  configure_file(${here}/copyright.in ${made}/${component}/copyright @ONLY)
  file(WRITE ${made}/${component}/changelog
    "${package} (${TROCAR_PACKAGE_VERSION}) bookworm; urgency=medium\n\n  * Built from this version of the sources; their history says what changed.\n\n -- ${maintainer}  ${date}\n")
  execute_process(COMMAND gzip -9nf ${made}/${component}/changelog COMMAND_ERROR_IS_FATAL ANY)
  install(FILES ${made}/${component}/copyright ${made}/${component}/changelog.gz DESTINATION share/doc/${package} COMPONENT ${component})
  install(FILES ${here}/${package}.lintian DESTINATION share/lintian/overrides RENAME ${package} COMPONENT ${component})
endforeach()

set(FEATURES)
if(TROCAR_MARCH STREQUAL x86-64-v3)
  set(FEATURES "avx2 bmi1 bmi2 f16c fma movbe")
endif()
configure_file(${here}/rig.preinst ${made}/preinst @ONLY)
foreach(script IN ITEMS postinst prerm postrm)
  configure_file(${here}/rig.${script} ${made}/${script} COPYONLY)
endforeach()
file(WRITE ${made}/conffiles "/etc/security/limits.d/trocar.conf\n/etc/trocar/rig.conf\n")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME trocar)
set(CPACK_PACKAGE_VERSION ${TROCAR_PACKAGE_VERSION})
set(CPACK_PACKAGE_CONTACT ${maintainer})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL rig host camera)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(CPACK_DEBIAN_RIG_PACKAGE_NAME trocar-rig)
set(CPACK_COMPONENT_RIG_DESCRIPTION "real-time controller of a needle-insertion rig
Runs the 1 kHz loop of a planar twin pantograph that drives a needle into
soft tissue, or lets a hand feel a virtual one: as a systemd service of its
own user, on CAN buses or on a simulated rig. Nothing moves before a host
arms it.")
set(CPACK_DEBIAN_RIG_PACKAGE_DEPENDS "adduser, iproute2")
set(CPACK_DEBIAN_RIG_PACKAGE_CONTROL_EXTRA "${made}/preinst;${made}/postinst;${made}/prerm;${made}/postrm;${made}/conffiles")

set(CPACK_DEBIAN_HOST_PACKAGE_NAME trocar)
set(CPACK_COMPONENT_HOST_DESCRIPTION "host and simulated rig of a needle-insertion rig
Command line that homes, arms and watches a rig, runs experiments, records
and reports them, and computes needles in tissue; with a simulated rig behind
the same wire.")
set(CPACK_DEBIAN_HOST_PACKAGE_DEPENDS "trocar-rig (= ${TROCAR_PACKAGE_VERSION})")
# Figures of reports; keys for a network.
set(CPACK_DEBIAN_HOST_PACKAGE_RECOMMENDS "gnuplot-nox | gnuplot, openssl, trocar-camera (= ${TROCAR_PACKAGE_VERSION})")

set(CPACK_DEBIAN_CAMERA_PACKAGE_NAME trocar-camera)
set(CPACK_COMPONENT_CAMERA_DESCRIPTION "camera commands for a needle-insertion rig
Calibrates and reads cameras, rectifies their images, registers them to the
rig, follows the markers of a phantom: what trocar camera and trocar track
start.")
set(CPACK_DEBIAN_CAMERA_PACKAGE_DEPENDS "trocar (= ${TROCAR_PACKAGE_VERSION})")
include(CPack)
