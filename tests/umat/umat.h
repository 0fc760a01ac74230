/* The arguments of UMAT, as Fortran passes them. */
#define UMAT(NAME)                                                                                                  \
    void NAME(double *stress, double *statev, double *ddsdde, double *sse, double *spd, double *scd, double *rpl,   \
              double *ddsddt, double *drplde, double *drpldt, const double *stran, const double *dstran,            \
              const double *time, const double *dtime, const double *temp, const double *dtemp,                     \
              const double *predef, const double *dpred, const char *cmname, const int *ndi, const int *nshr,       \
              const int *ntens, const int *nstatv, const double *props, const int *nprops, const double *coords,    \
              const double *drot, double *pnewdt, const double *celent, const double *dfgrd0, const double *dfgrd1, \
              const int *noel, const int *npt, const int *layer, const int *kspt, const int *kstep, const int *kinc)

void rotsig_(const double *s, const double *r, double *sprime, const int *lstr, const int *ndi, const int *nshr);
void sinv_(const double *s, double *sinv1, double *sinv2, const int *ndi, const int *nshr);
void sprinc_(const double *s, double *ps, const int *lstr, const int *ndi, const int *nshr);
void xit_(void);
