/* Types of the Functional Mock-up Interface 2.0 for co-simulation, after its specification (fmi-standard.org). */
#include <stddef.h>
#if defined _WIN32
#define FMI2 __declspec(dllexport)
#elif defined __GNUC__
#define FMI2 __attribute__((visibility("default")))
#else
#define FMI2
#endif
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Byte;
typedef const char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*fmi2Logger)(fmi2ComponentEnvironment, fmi2String name, fmi2Status, fmi2String kind, fmi2String text, ...);
typedef struct {
    fmi2Logger logger;
    void *(*allocateMemory)(size_t, size_t), (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment environment;
} fmi2CallbackFunctions;
