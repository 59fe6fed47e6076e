; gtc_<n>_saturate() (libc/gtc_saturate.inl), through which every correction goes that gtc_<n>_bias() and gtc_<n>_map() give:
; whatever the correction, of whatever state, and whatever bounds a table may have, the result lies within them.
; `unsat` says that no words break the claim.
(set-logic ALL)
(define-sort number () (_ FloatingPoint 8 24))
(declare-const x number)
(declare-const low number)
(declare-const high number)
; what `open`, `check` and `init` see to: numbers, the smallest not above 0, the largest not below it
(define-fun zero () number (_ +zero 8 24))
(define-fun limited () number (ite (and (fp.geq x low) (fp.leq x high)) x (ite (fp.gt x high) high low)))

(push)
(assert (and (fp.leq low zero) (fp.geq high zero)))
(assert (not (and (fp.leq low limited) (fp.leq limited high))))
(check-sat)
(pop)

(declare-const y (_ BitVec 64))
(declare-const least (_ BitVec 32))
(declare-const most (_ BitVec 32))
(define-fun wide ((a (_ BitVec 32))) (_ BitVec 64) ((_ sign_extend 32) a))
(define-fun whole () (_ BitVec 64) (ite (and (bvsge y (wide least)) (bvsle y (wide most))) y (ite (bvsgt y (wide most)) (wide most) (wide least))))

(push)
(assert (and (bvsle least #x00000000) (bvsge most #x00000000)))
(assert (not (and (bvsle (wide least) whole) (bvsle whole (wide most)))))
(check-sat)
(pop)
